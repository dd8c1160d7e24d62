"""The last accepted result of a cell: what is known of the geometry that its controller runs with."""

from datetime import datetime

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.config.change import Receipt
from hexacell.config.layout import fingerprint
from hexacell.config.write_record import later_approval
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.results.result import AcceptedResult, IdentificationResult, LengthResult
from hexacell.runs.run_folder import RunFolder, run_folders
from hexacell.services.history.journal_soundness import read_sound
from hexacell.services.history.recorded_cell import started_robot
from hexacell.verdict.decision import Verdict
from hexacell.verdict.length_check import with_measured_scale
from procedures.calibration.calibration import Calibration, Mode
from procedures.run.keys import Phase
from procedures.run.readings import mean_leg_temperatures
from procedures.run.state import RunState


def last_accepted_result(cell: Cell) -> AcceptedResult | None:
    """The newest accepted result whose config is the one that the controller has now, byte for byte.

    Runs whose files cannot be read are left out; an unreadable config is a ``FileError``.
    """
    written = fingerprint(*cell.config_paths)
    found = {run: one for run in run_folders(cell) if (one := _accepted(cell, run, written)) is not None}
    newest = max(found, key=lambda run: found[run][0], default=None)
    if newest is None:
        return None
    at, state, result = found[newest]
    terms = tuple(one for one in result.terms if one.is_taken)
    readings = [sample.reading for sample in state.samples(Phase.IDENTIFY)]
    return AcceptedResult(
        run=str(newest.path),
        at=at,
        covariance=result.covariance,
        effects=_effects(cell, state),
        identified=result.geometry if terms else None,
        terms=terms,
        length=_length(state),
        leg_temperatures_c=(
            result.holds_at_c or mean_leg_temperatures(cell.settings.thermometers, readings)
        ),
    )


def _accepted(
    cell: Cell, folder: RunFolder, sha256: str
) -> tuple[datetime, RunState, IdentificationResult] | None:
    """End and content of a run that wrote the config with this fingerprint, if its result stayed there."""
    try:
        if Receipt.of(folder.path).sha256_after != sha256:
            return None
        entries, state = read_sound(folder, cell.settings)
        is_applied_later = later_approval(folder) is not None
    except HexacellError:
        return None
    if state.identified is None or not _is_accepted(state, is_applied_later=is_applied_later):
        return None
    return entries[-1].at, state, state.identified.result


def _is_accepted(state: RunState, *, is_applied_later: bool) -> bool:
    """Whether the result passed, or a person kept it although its error is not certain to be within limits.

    Who had the proposal applied after the run kept it too. Where the model did not hold, nothing is known
    of the geometry, whoever kept it.
    """
    is_back = state.rolled_back or state.rolling_back
    if state.judged is None or (is_back and not is_applied_later):
        return False
    if state.judged.verdict is Verdict.PASS:
        return True
    verification = state.judged.verification
    if verification is not None and verification.is_kept:
        return True
    holds = verification is not None and all(test.passed for test in verification.tests)
    is_kept = state.accepted is not None and state.accepted.by is not None
    return holds and (is_kept or is_applied_later)


def _length(state: RunState) -> LengthResult | None:
    """What the length check of a run found, or of the run that it started from."""
    before = state.started and state.started.accepted
    found = state.accuracy and state.accuracy.length
    return found or (before.length if before else None)


def _effects(cell: Cell, state: RunState) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Errors of the result by the systematic effects that the cell file states now."""
    if state.started is None:
        return {}
    settings, started = cell.settings, state.started
    start = started_robot(settings, started)
    calibration = Calibration(settings, start, Mode(started.mode), accepted=started.accepted)
    robot = calibration.known(state).robot_of(state)
    effects = [one for one in with_measured_scale(robot.effects, _length(state)) if one.size]
    if not effects:
        return {}
    found = identify(robot.problem(state.measurements()))
    belief = robot.belief(found)
    budget = Task.of(settings, robot, belief).budget(
        found, belief, effects, robot.known_effects, zeros=robot.identified_zeros(found)
    )
    columns = {} if budget is None else budget.parameter_columns
    return {name: tuple(map(tuple, each.T.tolist())) for name, each in columns.items()}
