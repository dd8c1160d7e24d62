"""Directions of a run's records, where simulated joints have backlash: the ball is where they say."""

import asyncio
from contextlib import suppress

import numpy as np

from hexacell.errors import AnswerNeeded
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.csv_file import read_measurements
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import calibrate
from tests.hexacell.services.conftest import order_of
from tests.small_cell import few_candidates

LOST = (0.02, 0.016, 0.012, 0.024, 0.02, 0.01)
PRECISE = {
    "simulation.joints.backlash": LOST,
    "simulation.gauges.noise_mm": 0.0002,
    "simulation.encoders.noise": 0.0002,
}


def test_joints_stand_by_half_their_backlash_beside_their_encoders(make_cell, tmp_path) -> None:
    cell, folder = make_cell(**PRECISE), RunFolder(tmp_path / "run")
    with few_candidates(), suppress(AnswerNeeded):  # whether its result is approved is another matter
        asyncio.run(calibrate(order_of(cell, folder)))
    records = read_measurements(folder.measurements)
    settings, directions = cell.settings, records.directions
    assert settings.simulation is not None
    assert settings.simulation.geometry is not None
    mechanism = settings.mechanism
    truth = Geometry.of(mechanism.parameters, settings.simulation.geometry.model_dump())
    known = np.flatnonzero((directions != 0.0).all(axis=1))
    assert len(known) >= len(records) // 2

    def rms(share: float) -> float:
        """How far the ball is from where joints bring it that are so much of their backlash behind."""
        joints = records.joints - share * np.array(LOST) * directions
        found = forward_kinematics(mechanism, truth, joints, records.poses)
        assert found.found.all()
        beside = found.poses.positions - records.deviations
        parts = [beside[known[records.points[known] == point]] for point in records.counts]
        return float(np.sqrt(np.mean([(part - part.mean(axis=0)).var() for part in parts])))

    assert rms(0.5) < 0.002
    assert rms(0.0) > 5.0 * rms(0.5)
    assert rms(-0.5) > rms(0.0)
