"""What a run was and found, read from its folder: its summary, its result and its evidence."""

from collections.abc import Container, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.checks.change_alarm import has_silent_leg, machine_records
from hexacell.config.change import RECEIPT, Receipt
from hexacell.config.write_record import later_approval
from hexacell.errors import HexacellError, UsageError
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MEASURED_PARTS, MeasurementSet, RecordId
from hexacell.results.result import IdentificationResult
from hexacell.runs.run_folder import RunFolder, read_attempts
from hexacell.services.history.journal_soundness import read_sound
from hexacell.services.history.recorded_cell import started_robot
from hexacell.services.history.run_index import EvidenceDocument, RunSummary
from procedures.calibration.calibration import Calibration, Mode
from procedures.journal.journal import Entry, read_entries, read_journal
from procedures.run.keys import Phase
from procedures.run.readings import mean_temperature, on_parts
from procedures.run.state import RunState, fold
from procedures.steps import events


def run_summary(folder: RunFolder) -> RunSummary:
    """The summary of a run, by its folder alone; why it cannot be read, where it cannot."""
    try:
        if not folder.journal.is_file() and (attempts := read_attempts(folder)) is not None:
            first, last = attempts.attempts[0].at, attempts.last.at
            return RunSummary(
                began=first,
                ended=last,
                mode=attempts.mode,
                line=attempts.line,
                is_over=True,
                has_begun=False,
            )
        entries = read_entries(folder.journal)
    except HexacellError as error:
        return RunSummary(line=str(error))
    if not entries:
        return RunSummary(line="its journal is empty")
    state = fold(entry.event for entry in entries)
    written_sha256 = None
    with suppress(HexacellError):
        written_sha256 = Receipt.of(folder.path).sha256_after
    is_applied = (state.committed is not None and not state.rolled_back) or is_applied_later(folder)
    return RunSummary(
        began=entries[0].at,
        ended=entries[-1].at,
        mode="" if state.started is None else state.started.mode,
        records=sum(len(measured.samples) for measured in state.sets.values()),
        verdict=state.verdict,
        accuracy=state.accuracy,
        line=_last_line(entries, state),
        has_result=result_of_its_own(state) is not None,
        is_over=state.ended is not None,
        written_sha256=written_sha256,
        has_written=(folder.path / RECEIPT).is_file(),
        has_proposal=state.proposed is not None and folder.proposal.is_file() and not is_applied,
    )


def is_applied_later(folder: RunFolder) -> bool:
    """Whether a run's proposal was applied after it; also where the note of that is damaged."""
    try:
        return later_approval(folder) is not None
    except HexacellError:
        return True


def state_of(folder: RunFolder) -> RunState:
    """The state of a run as far as it got; empty where its journal cannot be read."""
    try:
        return fold(read_journal(folder.journal))
    except HexacellError:
        return RunState()


def result_of_its_own(state: RunState) -> IdentificationResult | None:
    """The result of the records of a run alone; None where nothing was identified, or by the quick level.

    The result of the quick level has the errors of the one that it started from: they are not independent.
    """
    is_quick = state.started is not None and state.started.mode == "quick"
    return None if state.identified is None or is_quick else state.identified.result


def require_result(state: RunState, run: str) -> IdentificationResult:
    """What the records of a run alone identified; raises ``UsageError`` where there is no such result."""
    if (result := result_of_its_own(state)) is None:
        raise UsageError(
            f"the run {run} identified no geometry of its own", action="Name calibrations, which do"
        )
    return result


def _last_line(entries: Sequence[Entry], state: RunState) -> str:
    if state.ended is not None:
        return state.ended.line
    last = entries[-1].event
    reason = last.reason if isinstance(last, events.Interrupted) else "it is going on, or was killed"
    return f"not over: {reason}"


REFERENCE_C = 20.0
"""Temperature at which legs with thermometers have the lengths that runs are compared by, deg C."""


def evidence_document(settings: CellSettings, folder: RunFolder) -> EvidenceDocument | None:
    """The evidence of a run by the settings that the cell has now.

    None without any: it is not over, measured no geometry, its residuals do not agree with the noise,
    it started from a drawing, a thermometer on a leg never answered, or its journal cannot be read.
    """
    try:
        entries, state = read_sound(folder, settings)
        if (counted := _counted(settings, state)) is None:
            return None
        calibration, free, false = counted
        samples = tuple(
            one for one in state.samples(Phase.IDENTIFY) if (one.at.point, one.orientation) not in false
        )
        if not samples:
            return None
        readings = [one.reading for one in samples]
        shown = [on_parts(settings.thermometers, reading.temperatures) for reading in readings]
        measured = zip(samples, shown, strict=True)
        told = MeasurementSet(tuple(replace(one.record, temperatures=row) for one, row in measured))
        if has_silent_leg(settings, told):
            return None
        robot = calibration.known(state).robot_of(state)
        at_reference = replace(robot.expansion, reference_c=(REFERENCE_C,) * MEASURED_PARTS)
        records = machine_records(replace(robot, expansion=at_reference), told, free)
    except (HexacellError, np.linalg.LinAlgError):  # records that fit no robot near this one
        return None
    return EvidenceDocument.of(entries[-1].at, mean_temperature(readings), len(free), records.evidence)


def _counted(
    settings: CellSettings, state: RunState
) -> tuple[Calibration, Array, Container[RecordId]] | None:
    """A run that counts, the free parameters (p,) where it is linearized, and its false records.

    A calibration that converged is linearized at its own result, a check of a calibrated robot at the
    calibration's.
    """
    started, identified = state.started, state.identified
    check = None if state.judged is None else state.judged.check
    if started is None:
        return None
    robot = started_robot(settings, started)
    if identified is not None and identified.result.converged:
        result, mechanism = identified.result, settings.mechanism
        free = mechanism.convention.free_parameters(result.identified(mechanism.parameters))
        false = {(one.point, one.orientation) for one in result.outliers}
        return Calibration(settings, robot, Mode.OPTIMISE, accepted=started.accepted), free, false
    if check is None or check.earlier_run is None or not check.is_consistent:
        return None
    calibration = Calibration(settings, robot, Mode.CHECK, accepted=started.accepted)
    return calibration, calibration.known(state).robot_of(state).free_parameters, check.left_out
