"""The assessment of an identification: can it be trusted, and how accurate is the robot with it?"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, repeat

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.design.decorrelation import DecorrelatingPose, decorrelating_poses
from hexacell.identification.diagnostics.model_tests import contradicted_points, leave_one_point_out
from hexacell.identification.diagnostics.pose_accuracy import Accuracy, predicted_accuracy
from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation
from hexacell.identification.identified_zeros import IdentifiedZeros
from hexacell.identification.solver.chi_square import CONTRADICTED_RATIO, ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.result import CorrelatedPair, Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.record_noise import NoiseLevels, Repeatability, noise_levels, repeatability
from hexacell.results.result import ExpectedImprovement
from hexacell.results.term_result import corrections_for, impossible_terms, term_results
from hexacell.robot.model import Robot
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.possible_causes import PossibleCause, possible_causes
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from hexacell.verdict.acceptance_gates import AcceptanceGate, gates

SEPARATED_PAIRS = 5
"""Number of the strongest correlations for which a separating measurement is searched."""


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """An identification beside the drawing, its checks against the data, and the accuracy they predict.

    Attributes:
        noise: noise levels estimated from the residuals; None without redundancy.
        repeatability: None where no pose was visited twice.
        record_noise_mm: scatter of a deviation by the stated noise (root mean square distance), to
            compare the repeatability with.
        correlated: strongly correlated pairs of parameters, the strongest first; with the first
            ``SEPARATED_PAIRS`` the record that would separate them, commanded in the controller's frames.
        task: poses at which the accuracy is predicted, in the controller's frames.
        task_named: whether the cell file names these poses; else they span the workspace.
        budget: uncertainty of the errors at the reachable task poses; None where there are none.
        accuracy: at the task poses; None where the robot can reach none of them. Where the residuals
            are larger than the stated noise, the predicted error is as well.
        points: each point's records predicted by the others, where those determine the geometry.
        measured_noise: at the start of the run that took the records; None where that is not known.
        possible_causes: causes of residuals that are too large, the largest share first.
        impossible: what was found beside the geometry that no machine has.
        zeros: where these alone are identified; ``found`` is the estimate of all, which tests the data.
    """

    found: Identification
    drawing: Geometry
    noise: NoiseLevels | None
    repeatability: Repeatability | None
    record_noise_mm: float
    correlated: tuple[tuple[CorrelatedPair, DecorrelatingPose | None], ...]
    task: tuple[Pose, ...]
    task_named: bool
    accuracy: Accuracy | None
    budget: UncertaintyBudget | None = None
    tolerance_violations: tuple[ToleranceViolation, ...] = ()
    possible_causes: tuple[PossibleCause, ...] = ()
    measured_noise: MeasuredNoise | None = None
    points: Mapping[int, ChiSquareTest] = field(default_factory=dict)
    zeros: IdentifiedZeros | None = None
    unknown_mm: float = 0.0
    limit_mm: float = np.inf
    impossible: tuple[str, ...] = ()

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Identified parameters that the data hardly determine."""
        return (self.zeros or self.found).undetermined

    @property
    def gates(self) -> tuple[AcceptanceGate, ...]:
        """Those of a run, but for the size of the change: nothing is written."""
        found, impossible = self.found, self.impossible
        return gates(
            found.estimate, self.tolerance_violations, residuals=found.goodness, impossible=impossible
        )

    @property
    def is_evident(self) -> bool:
        """Whether no records contradict the model, so that an expanded uncertainty by it can be stated."""
        is_too_large = self.found.goodness.agreement is ChiSquareVerdict.TOO_LARGE
        return not is_too_large and not contradicted_points(self.points)

    @property
    def refused(self) -> bool:
        """Whether a gate of a run refuses the geometry."""
        return any(gate.refuses for gate in self.gates)

    @property
    def is_usable(self) -> bool:
        """Whether no gate refuses the geometry, and the task poses are known."""
        return not self.refused and not self.determines_too_little

    @property
    def determines_too_little(self) -> bool:
        """Whether the records leave the error at a task pose unknown by more than its limit."""
        return COVERAGE_FACTOR * self.unknown_mm > self.limit_mm

    @property
    def improvement(self) -> ExpectedImprovement | None:
        """What the identified geometry is good for; None where the robot can reach no task pose."""
        if self.accuracy is None or self.budget is None:
            return None
        return ExpectedImprovement(
            now_mm=self.accuracy.before.position_largest_mm, expanded_mm=self.budget.expanded_mm
        )

    @property
    def does_not_repeat(self) -> bool:
        """Whether the machine's scatter exceeds the error that a calibration would remove."""
        if self.repeatability is None or self.accuracy is None:
            return False
        return self.repeatability.dominates(self.accuracy.removable_mm)


def assess(
    settings: CellSettings,
    robot: Robot,
    measurements: MeasurementSet,
    found: Identification,
    measured_noise: MeasuredNoise | None = None,
) -> Assessment:
    """Check an identification of some measurements, and predict the accuracy with it.

    ``measured_noise`` is what settings and robot contain already.
    """
    left_out = {record for record, _ in found.left_out}
    belief, zeros = robot.belief(found), robot.identified_zeros(found)
    if zeros is not None:
        belief = replace(belief, covariance=zeros.free_covariance)
    task = Task.of(settings, robot, belief)
    error = task.error(belief)
    accuracy = predicted_accuracy(belief, task=task.poses, workspace=task.workspace)
    pairs, goodness = found.strongly_correlated(), found.goodness
    separating = decorrelating_poses(robot.belief(found), found, pairs[:SEPARATED_PAIRS])
    commands = [pose and replace(pose, command=robot.to_command(pose.command)) for pose in separating]
    record_noise = found.problem.noise.record_covariance(found.prediction.by_joints)
    corrections, _ = corrections_for(term_results(found), settings, robot.holds, robot.corrections)
    # Residuals that are too large, and small enough to be explained to first order.
    is_doubtful = goodness.agreement is ChiSquareVerdict.TOO_LARGE and goodness.ratio <= CONTRADICTED_RATIO
    return Assessment(
        found=found,
        drawing=robot.mechanism.normalize_frames(robot.drawing)[0],
        noise=noise_levels(found),
        repeatability=repeatability(measurements, left_out),
        record_noise_mm=float(np.sqrt(np.mean(np.trace(record_noise, axis1=-2, axis2=-1)))),
        correlated=tuple(zip(pairs, chain(commands, repeat(None)), strict=False)),
        task=tuple(robot.to_command(task.poses.pose(row)) for row in range(len(task.poses))),
        task_named=bool(settings.task.poses),
        accuracy=accuracy and replace(accuracy, after=accuracy.after.times(goodness.noise_factor)),
        budget=task.budget(
            found,
            belief if corrections is None else replace(belief, corrections=corrections),
            robot.effects,
            robot.known_effects,
            zeros=zeros,
        ),
        tolerance_violations=robot.tolerance_violations(found.estimate),
        possible_causes=possible_causes(found) if found.termination.converged and is_doubtful else (),
        measured_noise=measured_noise,
        points=leave_one_point_out(found) if found.termination.converged else {},
        zeros=zeros,
        unknown_mm=0.0 if error is None else error.worst(belief.covariance),
        limit_mm=settings.acceptance.position_mm,
        impossible=tuple(impossible_terms(robot.terms, term_results(found))),
    )
