"""The evidence of a recorded run on the geometry, from its folder, as the archive keeps it."""

from collections.abc import Container

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.checks.change_alarm import leg_expansion, machine_records
from hexacell.errors import HexacellError
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, RecordId
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_index import EvidenceDocument
from hexacell.services.recorded.journal_soundness import read_sound
from hexacell.services.recorded.recorded_robot import started_robot
from procedures.calibration.calibration import Calibration, Mode
from procedures.run.keys import Phase
from procedures.run.readings import legs_warmer, mean_temperature
from procedures.run.state import RunState

REFERENCE_C = 20.0
"""Temperature at which legs with thermometers have the lengths that runs are compared by, deg C."""


def evidence_document(settings: CellSettings, folder: RunFolder) -> EvidenceDocument | None:
    """The evidence of a run by the settings that the cell has now.

    None without any: it is not over, measured no geometry, its residuals do not agree with the noise,
    it started from a drawing, a thermometer on a leg never answered, or its journal cannot be read.
    """
    try:
        entries, state = read_sound(folder, settings)
        counted = _counted(settings, state)
        if counted is None:
            return None
        calibration, free, false = counted
        samples = tuple(
            one for one in state.samples(Phase.IDENTIFY) if (one.at.point, one.orientation) not in false
        )
        if not samples:
            return None
        readings = [one.reading for one in samples]
        warmer = legs_warmer(settings.thermometers, readings, [REFERENCE_C] * LEGS)
        geometry = settings.mechanism.convention.geometry(free)
        expansion = leg_expansion(geometry, settings.uncertainty.expansion_legs_um_m_k, warmer)
        if np.isnan(expansion).any():
            return None
        measurements = MeasurementSet(tuple(one.record for one in samples))
        records = machine_records(calibration.known(state).robot_of(state), measurements, free, expansion)
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
