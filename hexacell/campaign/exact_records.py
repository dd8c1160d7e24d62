"""Records of a robot that is exactly as its controller has it, without noise."""

from __future__ import annotations

from collections.abc import Iterator

from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import Record, deviation_of, joints_of
from hexacell.robot.model import Robot


def exact_records(robot: Robot, point: int, poses: PoseBatch) -> Iterator[Record]:
    """The records of a point, counted from 1, at poses in the convention's frames, the reference first."""
    joints = robot.mechanism.inverse(robot.commanding, robot.branch, poses)
    shown = (poses.positions - poses.positions[:1]) @ robot.frames.base
    for row in range(len(poses)):
        command = robot.to_command(poses.pose(row))
        yield Record(point, row + 1, command, joints_of(joints[row]), deviation_of(shown[row]))
