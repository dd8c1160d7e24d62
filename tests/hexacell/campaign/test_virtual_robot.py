"""The records of a virtual robot say from which side its joints arrived."""

from dataclasses import replace

import numpy as np

from hexacell.kinematics.pose import Pose
from hexacell.robot.virtual_robot import exact_records

REFERENCE = Pose(60.0, -60.0, 540.0)
POSES = [
    Pose(61.0, -62.0, 541.0, 4.0, 3.0, -9.0),
    Pose(60.0, -58.0, 539.0, -6.0, 5.0, 14.0),
    Pose(59.0, -60.0, 547.0, 7.0, -3.0, 2.0),
]


def test_exact_records_have_the_directions_of_the_straight_ways(make_plan):
    robot = make_plan().robot
    silent = replace(robot, noise=replace(robot.noise, encoder=0.0, gauge_mm=0.0, stops=0.0))
    commands = silent.from_commands([REFERENCE, *POSES])
    records = [*exact_records(silent, 1, commands)]
    joints = np.array([one.joints for one in records])
    assert records[0].directions == (0,) * 6
    ways = np.diff(joints, axis=0)
    sure = np.abs(ways) > 0.3
    directions = np.array([one.directions for one in records[1:]])
    np.testing.assert_array_equal(directions[sure], np.sign(ways)[sure])
    assert sure.mean() > 0.8
