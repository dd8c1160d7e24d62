"""What a machine with scaled encoders gives in the two seats of a fixture, by leg equations alone."""

from typing import Any

import numpy as np

from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of
from hexacell.robot.model import Robot
from tests.hexacell.conftest import vector
from tests.hexacell.uncertainty.two_seats import TwoSeats


def two_seat_records(
    robot: Robot,
    fixture: LengthCheckSettings,
    paper: Any,
    legs: Any,
    *,
    long_um_m: float = 0.0,
    distance_mm: float | None = None,
    zeroed_mm: float = 0.0,
    noise_mm: float = 0.005,
) -> MeasurementSet:
    """Records of the robot of Table 1 under its controller, in the controller's frames.

    ``distance_mm`` is the true one of the seats; ``zeroed_mm`` is what the gauges show less from the second
    mounting on.
    """
    random = np.random.default_rng(5)
    first, second = np.array(fixture.first_seat), np.array(fixture.second_seat)
    seats = TwoSeats(
        fixture.distance_mm,
        (second - first) / fixture.distance_mm,
        first,
        fixture.mountings,
        zeroed_mm=np.full(3, zeroed_mm),
        true_mm=distance_mm,
    )
    mountings, poses = zip(*seats.commands(), strict=True)
    shown = np.array([legs(robot.controller).joints(vector(pose)) for pose in poses])
    moved = shown / (1.0 + 1e-6 * long_um_m)
    balls = np.array([_ball(robot, legs(paper.actual), *one) for one in zip(moved, poses, strict=True)])
    deviations = seats.deviations(np.array(mountings), balls, random)
    deviations += noise_mm * random.standard_normal(balls.shape)
    shown += noise_mm * random.standard_normal(shown.shape)
    each = len(poses) // fixture.mountings
    return MeasurementSet(
        tuple(
            Record(mounting, row % each + 1, pose, joints_of(shown[row]), deviation_of(deviations[row]))
            for row, (mounting, pose) in enumerate(seats.commands())
        )
    )


def _ball(robot: Robot, legs: Any, joints: Any, pose: Pose) -> Any:
    """Where the ball is, in the controller's base frame."""
    near = vector(robot.from_commands([pose]).pose(0))
    return robot.frames.base.T @ legs.closed(joints, near)[:3]
