"""A virtual robot with backlash stands where the directions of its records say."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.pose import Pose
from hexacell.robot.virtual_robot import LostMotion, VirtualRobot, exact_records

REFERENCE = Pose(60.0, -60.0, 540.0)
POSES = [
    Pose(61.0, -62.0, 541.0, 4.0, 3.0, -9.0),
    Pose(60.0, -58.0, 539.0, -6.0, 5.0, 14.0),
    Pose(59.0, -60.0, 547.0, 7.0, -3.0, 2.0),
]


@pytest.fixture
def silent(make_plan):
    robot = make_plan().robot
    return replace(robot, noise=replace(robot.noise, encoder=0.0, gauge_mm=0.0, stops=0.0))


@pytest.mark.parametrize("way", ["move", "place"])
def test_it_stands_by_half_the_lost_motion_beside_its_encoders(silent, paper, way):
    lost = np.linspace(0.02, 0.12, 6)
    virtual = VirtualRobot(silent, paper.actual, beside=LostMotion(lost))
    virtual.place(REFERENCE)
    assert virtual.measure(1, 1).directions == (0,) * 6
    records = []
    for orientation, pose in enumerate(POSES, start=2):
        getattr(virtual, way)(pose)
        records.append(virtual.measure(1, orientation))
    joints = np.array([one.joints for one in records])
    directions = np.array([one.directions for one in records])
    assert np.all(directions != 0)
    assert np.any(np.abs(directions.sum(axis=0)) < len(POSES))
    found = continue_solution(
        silent.mechanism,
        paper.actual,
        joints - 0.5 * lost * directions,
        start=silent.from_commands(POSES),
        start_geometry=silent.commanding,
        start_joints=joints,
    )
    assert found.found.all()
    ball = found.poses.positions @ silent.frames.base
    shown = np.array([one.deviation for one in records])
    np.testing.assert_allclose(shown - shown[0], ball - ball[0], atol=1e-5)


def test_exact_records_have_the_directions_of_the_straight_ways(silent):
    commands = silent.from_commands([REFERENCE, *POSES])
    records = [*exact_records(silent, 1, commands)]
    joints = np.array([one.joints for one in records])
    assert records[0].directions == (0,) * 6
    ways = np.diff(joints, axis=0)
    sure = np.abs(ways) > 0.3
    directions = np.array([one.directions for one in records[1:]])
    np.testing.assert_array_equal(directions[sure], np.sign(ways)[sure])
    assert sure.mean() > 0.8
