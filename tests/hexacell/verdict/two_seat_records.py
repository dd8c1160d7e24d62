"""What a machine with scaled encoders gives in the two seats of a fixture, by leg equations alone."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of
from hexacell.robot.model import Robot

PROBE_MM = np.array([1.0, -0.8, 0.6])
TILTS = ((0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0))
NOTHING = np.zeros(3)


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
    rows = [
        (mounting, number, pose)
        for mounting in range(1, fixture.mountings + 1)
        for number, pose in enumerate(_commands(fixture, mounting), start=1)
    ]
    shown = [legs(robot.controller).joints(_vector(pose)) for *_, pose in rows]
    balls = np.array(
        [
            _ball(robot, legs(paper.actual), q / (1.0 + 1e-6 * long_um_m), p)
            for q, (*_, p) in zip(shown, rows, strict=True)
        ]
    )
    first, second = np.array(fixture.first_seat), np.array(fixture.second_seat)
    between = (second - first) / fixture.distance_mm * (distance_mm or fixture.distance_mm)
    records = []
    for (mounting, number, pose), joints, ball in zip(rows, shown, balls, strict=True):
        seat = balls[0] + (between if mounting % 2 == 0 else NOTHING)
        deviation = (
            ball - seat - (zeroed_mm if mounting > 1 else 0.0) + noise_mm * random.standard_normal(3)
        )
        read = joints + noise_mm * random.standard_normal(6)
        records.append(Record(mounting, number, pose, joints_of(read), deviation_of(deviation)))
    return MeasurementSet(tuple(records))


def _commands(fixture: LengthCheckSettings, mounting: int) -> list[Pose]:
    place = np.array(fixture.first_seat if mounting % 2 else fixture.second_seat)
    middle = [_pose(place, a, b) for a, b in TILTS]
    return [*middle, _pose(place + PROBE_MM, 0.0, 0.0)]


def _pose(position: Any, a: float, b: float) -> Pose:
    x, y, z = position.tolist()
    return Pose(x, y, z, a, b)


def _vector(pose: Pose) -> Any:
    turn = Rotation.from_euler("xyz", [pose.a, pose.b, pose.c], degrees=True)
    return np.concatenate([[pose.x, pose.y, pose.z], turn.as_rotvec()])


def _ball(robot: Robot, legs: Any, joints: Any, pose: Pose) -> Any:
    """Where the ball is, in the controller's base frame."""
    near = robot.from_commands([pose])
    start = np.concatenate([near.positions[0], Rotation.from_matrix(near.rotations[0]).as_rotvec()])
    return robot.frames.base.T @ legs.closed(joints, start)[:3]
