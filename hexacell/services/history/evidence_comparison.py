"""Any two runs compared by their records, where one measured too little for a geometry of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.checks.change_alarm import machine_causes
from hexacell.drift.carried_posterior import CarriedPosterior
from hexacell.drift.leg_evidence import likeliest_leg
from hexacell.drift.run_evidence import RunEvidence
from hexacell.drift.step_location import step_gains
from hexacell.errors import UsageError
from hexacell.robot.model import Robot, robot_of
from hexacell.runs.run_folder import RunFolder, find_run
from hexacell.services.history.run_evidence_document import evidence_document


@dataclass(frozen=True, slots=True)
class CauseOfDifference:
    """A parameter, taken alone, as what changed from one run to the other.

    ``score`` is standard normal if nothing changed.
    """

    name: str
    unit: str
    leg: int
    change: float
    sigma: float
    score: float


@dataclass(frozen=True, slots=True)
class EvidenceComparison:
    """What the records of two runs say of a change between them.

    Attributes:
        causes: the parameters that both runs see.
        limit: of the largest score, which by chance is larger in one case of a hundred.
        leg: that changed, if one did.
    """

    before: RunFolder
    after: RunFolder
    causes: tuple[CauseOfDifference, ...]
    limit: float
    leg: int

    @property
    def is_changed(self) -> bool:
        """Whether the machine differs by more than the noise of the records."""
        return any(abs(one.score) > self.limit for one in self.causes)

    @property
    def likeliest(self) -> CauseOfDifference:
        """The likeliest cause of the leg."""
        return max((one for one in self.causes if one.leg == self.leg), key=lambda one: abs(one.score))


def compare_evidence(cell: Cell, before: str, after: str) -> EvidenceComparison:
    """Compare two runs of a cell, by folder or name.

    Raises:
        UsageError: there is no such run, or as :func:`compare_run_folders`.
        FileError: the controller's config cannot be read.
    """
    folders = find_run(cell, before), find_run(cell, after)
    return compare_run_folders(cell.settings, robot_of(cell), *folders)


def compare_run_folders(
    settings: CellSettings, robot: Robot, before: RunFolder, after: RunFolder
) -> EvidenceComparison:
    """Compare two runs by what their folders have.

    Raises:
        UsageError: one of them says nothing of the geometry, or both see nothing in common.
    """
    first, second = (_evidence(settings, folder) for folder in (before, after))
    states = len(first.weighted)
    if len(second.weighted) != states:
        raise UsageError("these runs are of different mechanisms", action="Compare runs of one")
    causes = machine_causes(robot, states)
    known = CarriedPosterior.diffuse(causes.free, states - causes.free)
    scores = known.after(first).scores(second, causes.by_state)
    steps = step_gains(known, [first, second], causes.by_state)
    changes, sigmas = steps.changes[1], steps.sigmas[1]
    seen = np.flatnonzero(~np.isnan(scores) & np.isfinite(sigmas))
    if not len(seen):
        raise UsageError("these runs see nothing in common", action="Compare each with a calibration")
    parameters = settings.mechanism.parameters.parameters
    numbers = np.column_stack([changes, sigmas, scores])[seen].tolist()
    named = zip([parameters[row] for row in seen.tolist()], numbers, strict=True)
    found = tuple(CauseOfDifference(one.name, one.kind.unit.value, one.leg, *each) for one, each in named)
    limit = known.after(first).largest_score_by_chance(second, causes.by_state[seen])
    leg = likeliest_leg(scores[seen], sigmas[seen], causes.legs[seen])
    return EvidenceComparison(before, after, found, limit, leg)


def _evidence(settings: CellSettings, folder: RunFolder) -> RunEvidence:
    found = evidence_document(settings, folder)
    if found is None:
        raise UsageError(
            f"the run {folder.path.name} says nothing of the geometry",
            action="Name runs that measured it and whose records agree with the noise",
        )
    return found.evidence
