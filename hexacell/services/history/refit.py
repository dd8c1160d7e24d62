"""The records of an old run identified again, with the cell file and the program of today."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.cell.loader import Cell
from hexacell.errors import UsageError
from hexacell.identification.estimator import identify
from hexacell.results.result import IdentificationResult
from hexacell.results.run_comparison import ParameterDifference, result_differences
from hexacell.runs.run_folder import RunFolder, find_run
from hexacell.services.recorded.journal_soundness import require_sound
from hexacell.services.recorded.started_robot import started_robot
from procedures.calibration.workflow import Calibration, Mode
from procedures.journal.journal import read_journal
from procedures.run.state import RunState


@dataclass(frozen=True, slots=True)
class RefittedRun:
    """A run's result as it was found then, and as its records give it today.

    Attributes:
        parameters: the free ones; ``before`` is that of then, ``sigma`` that of today's result. Both are of
            the same records, so that no noise lies between them.
    """

    folder: RunFolder
    then: IdentificationResult
    today: IdentificationResult
    parameters: tuple[ParameterDifference, ...]

    @property
    def largest(self) -> ParameterDifference:
        """The parameter that differs most, in standard deviations."""
        return max(self.parameters, key=lambda one: abs(one.change) / one.sigma)


def refit_run(cell: Cell, named: str) -> RefittedRun:
    """Identify a calibration again, by its folder or name; nothing is written.

    Raises:
        UsageError: there is no such run, it identified nothing, or was of another mechanism.
        FileError: its journal cannot be read, or is not of such a run.
        IdentifiabilityError: under today's model the records do not belong to the robot.
    """
    folder = find_run(cell, named)
    history = read_journal(folder.journal)
    state = require_sound(history, cell.settings, folder.journal, follows_plan=False)
    if state.identified is None or state.started is None or not state.measurements().records:
        raise UsageError(
            f"the run {folder.path.name} identified no geometry",
            action="Name a calibration: checks measure less",
        )
    then, today = state.identified.result, _identified(cell, state)
    mechanism = cell.settings.mechanism
    every = result_differences(mechanism.parameters, then, today)
    free = {mechanism.parameters.names[row] for row in mechanism.convention.free_rows()}
    return RefittedRun(folder, then, today, tuple(one for one in every if one.name in free))


def _identified(cell: Cell, state: RunState) -> IdentificationResult:
    started = state.started
    assert started is not None  # noqa: S101 - seen by the caller
    robot = started_robot(cell.settings, started)
    known = Calibration(cell.settings, robot, Mode(started.mode), accepted=started.accepted).robot_of(state)
    found = identify(known.problem(state.measurements()))
    return IdentificationResult.of(found, known.identified_zeros(found))
