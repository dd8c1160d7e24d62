"""What the program states of an identified machine: the one place to exchange when it states more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.robot.model import Robot
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.propagation import Propagation
from hexacell.uncertainty.statement import LargestError
from hexacell.verdict.decision import Verdict, decide

LIMIT_MM = 0.33
"""On the largest error at a task pose: one that most machines without mistakes pass."""


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """What is stated of a written geometry.

    Attributes:
        error: at the worst task pose, mm, with U.
        sigma_mm: what comes of the noise of the records there, one sigma.
        has_evidence: whether the records agree with the model.
        poses: the task poses that it holds for, in the convention's frames.
        workspace: poses over which the frames are fitted.
        budget: what U consists of.
    """

    error: LargestError
    sigma_mm: float
    has_evidence: bool
    poses: PoseBatch
    workspace: PoseBatch
    budget: UncertaintyBudget

    def verdict(self, limit_mm: float = LIMIT_MM) -> Verdict:
        """The decision against the limit."""
        return decide(self.error, limit_mm) if self.has_evidence else Verdict.NOT_EVALUATED


def stated(
    settings: CellSettings, robot: Robot, found: Identification, effects: Sequence[Effect]
) -> Stated:
    """The statement about the geometry of an identification, once it is written."""
    belief = robot.belief(found)
    reached = Task.of(settings, robot, belief).reachable(belief)
    task, workspace = reached.poses, reached.workspace
    propagation = Propagation.of(found, belief, task=task, workspace=workspace)
    budget = UncertaintyBudget.of(propagation, effects)
    agrees = found.goodness.agreement is not ChiSquareVerdict.TOO_LARGE
    return Stated(
        error=LargestError(0.0, budget.expanded_mm),
        sigma_mm=budget.noise_mm,
        has_evidence=bool(agrees and found.converged and not found.undetermined),
        poses=task,
        workspace=workspace,
        budget=budget,
    )
