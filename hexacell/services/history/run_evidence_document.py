"""The evidence of a recorded run on the geometry, from its folder, as the archive keeps it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.checks.change_alarm import leg_expansion, machine_records
from hexacell.errors import HexacellError
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, RecordId
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_index import EvidenceDocument
from hexacell.services.recorded.journal_soundness import require_sound
from hexacell.services.recorded.recorded_robot import started_robot
from procedures.calibration.workflow import Calibration, Mode
from procedures.journal.journal import read_entries
from procedures.run import events
from procedures.run.leg_temperatures import legs_warmer, mean_temperature
from procedures.run.state import RunState, record
from procedures.run.steps import Phase

REFERENCE_C = 20.0
"""The temperature at which legs with thermometers have the lengths that runs are compared by."""


def evidence_document(settings: CellSettings, folder: RunFolder) -> EvidenceDocument | None:
    """The evidence of a run by the settings that the cell has now.

    None where it has none: it is not over, measured no geometry, its residuals do not agree with the noise,
    it started from a drawing, a thermometer on a leg never answered, or its journal cannot be read.
    """
    try:
        entries = read_entries(folder.journal)
        history = (entry.event for entry in entries)
        state = require_sound(history, settings, folder.journal, follows_plan=False)
        counted = _counted_calibration(settings, state) or _counted_check(settings, state)
        if counted is None or not counted.samples:
            return None
        expansion = _expansion(settings, counted)
        if np.isnan(expansion).any():
            return None
        robot, free = counted.calibration.robot_of(state), counted.free
        records = machine_records(robot, counted.measurements, free, expansion)
    except (HexacellError, np.linalg.LinAlgError):  # records that fit no robot near this one
        return None
    celsius = mean_temperature(counted.samples)
    return EvidenceDocument.of(entries[-1].at, celsius, len(free), records.evidence)


@dataclass(frozen=True, slots=True, eq=False)
class _CountedRun:
    """A run that counts, its records without false ones, and where they are linearized."""

    calibration: Calibration
    samples: tuple[events.RecordTaken, ...]
    free: Array

    @property
    def measurements(self) -> MeasurementSet:
        """The records."""
        return MeasurementSet(tuple(map(record, self.samples)))


def _counted_calibration(settings: CellSettings, state: RunState) -> _CountedRun | None:
    """A calibration that converged, at its own result."""
    if state.identified is None or not state.identified.result.converged:
        return None
    calibration = _calibration(settings, state, Mode.OPTIMISE)
    result, mechanism = state.identified.result, settings.mechanism
    free = mechanism.convention.free_parameters(result.identified(mechanism.parameters))
    false = {(one.point, one.orientation) for one in result.outliers}
    return None if calibration is None else _CountedRun(calibration, _without(state, false), free)


def _counted_check(settings: CellSettings, state: RunState) -> _CountedRun | None:
    """A check of a calibrated robot, at the calibration's result."""
    check = None if state.judged is None else state.judged.check
    if check is None or check.earlier_run is None or not check.is_consistent:
        return None
    calibration = _calibration(settings, state, Mode.CHECK)
    if calibration is None:
        return None
    free = calibration.robot_of(state).free_parameters
    return _CountedRun(calibration, _without(state, set(check.left_out)), free)


def _calibration(settings: CellSettings, state: RunState, mode: Mode) -> Calibration | None:
    started = state.started
    if started is None:
        return None
    robot = started_robot(settings, started)
    return Calibration(settings, robot, mode, accepted=started.accepted)


def _without(state: RunState, false: set[RecordId]) -> tuple[events.RecordTaken, ...]:
    samples = state.samples(Phase.IDENTIFY)
    return tuple(one for one in samples if (one.at.point, one.orientation) not in false)


def _expansion(settings: CellSettings, counted: _CountedRun) -> Array:
    """By how much the legs were longer (n, P) than at the reference temperature, by their thermometers."""
    geometry = settings.mechanism.convention.geometry(counted.free)
    warmer = legs_warmer(settings.thermometers, counted.samples, [REFERENCE_C] * LEGS)
    return leg_expansion(geometry, settings.uncertainty.expansion_legs_um_m_k, warmer)
