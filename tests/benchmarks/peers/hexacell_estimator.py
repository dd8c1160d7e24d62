"""Ours: Levenberg-Marquardt on the free parameters, poses eliminated, weights from the noise."""

from __future__ import annotations

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of
from hexacell.robot.model import robot_of
from tests.benchmarks.peers.interface import Array, Records

ROBOT = robot_of(load_cell(bundled_config("simulated-hexaglide")))


def solve(records: Records) -> Array:
    """What ``hexacell fit`` computes."""
    measured = MeasurementSet(
        tuple(
            Record(
                int(row[0]),
                int(row[1]),
                Pose(*row[2:8].tolist()),
                joints_of(row[8:14]),
                deviation_of(row[14:]),
            )
            for row in records.rows
        )
    )
    try:
        return identify(ROBOT.problem(measured)).geometry.vector
    except HexacellError as error:
        raise ArithmeticError(str(error)) from error
