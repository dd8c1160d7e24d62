"""Limits of commands and of the robot that they move."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.limits.limits import AxisLimits, Limits

LIMITS = Limits(5.0, np.radians(45.0), -800.0, 800.0, 0.03, turn=np.radians(60.0))


def of(*poses):
    return PoseBatch.of([Pose(0, 0, 550, *angles) for angles in poses])


def test_tilt_and_turn_of_commands_are_limited():
    commands = of((44.9,), (45.1,), (0, -44.9), (0, 0, 59.9), (0, 0, -60.1), (30, 0, 59))
    np.testing.assert_array_equal(LIMITS.allow_commands(commands), [True, False, True, True, False, True])


def test_a_pose_at_a_limit_is_within_it():
    assert LIMITS.allow_commands(of((45.0,), (0, 45.0), (0, 0, 60.0), (0, 0, -60.0))).all()


def test_the_turn_is_that_before_the_tilt():
    rng = np.random.default_rng(3)
    turns = rng.uniform(-170, 170, 20)
    untilted = PoseBatch.of([Pose(0, 0, 550, 0, 0, turn) for turn in turns])
    axis = rng.standard_normal((20, 2))
    from scipy.spatial.transform import Rotation

    tilts = Rotation.from_rotvec(np.column_stack([0.3 * axis, np.zeros(20)])).as_matrix()
    poses = PoseBatch(untilted.positions, tilts @ untilted.rotations)
    np.testing.assert_allclose(np.degrees(poses.turns()), turns, atol=1e-9)


def test_axes_are_limited_in_the_controllers_numbers():
    axes = AxisLimits(
        (-100.0, -np.inf, 400.0, -20.0, -90.0, -180.0), (100.0, np.inf, 600.0, 20.0, 90.0, 15.0)
    )
    commands = PoseBatch.of(
        [
            Pose(100, 900, 400, 20, 0, 15),
            Pose(101, 0, 500),
            Pose(0, 0, 399),
            Pose(0, 0, 500, -21),
            Pose(0, 0, 500, 0, 0, 16),
        ]
    )
    allowed = replace(LIMITS, axes=axes).allow_commands(commands)
    np.testing.assert_array_equal(allowed, [True, False, False, False, False])


def test_joints_have_ranges_of_their_own():
    lowest = np.array([-800.0, -800.0, -800.0, -200.0, -200.0, -200.0])
    limits = replace(LIMITS, joint_min=lowest, joint_max=-lowest[::-1])
    joints = np.array([[-300.0] * 3 + [300.0] * 3, [-300.0] * 3 + [-201.0] + [300.0] * 2, [np.nan] * 6])
    np.testing.assert_array_equal(limits.allow_joints(joints), [True, False, False])
    assert limits.joint_ranges[0] == (-800.0, 200.0)


def test_a_robot_beyond_a_limit_may_come_back_and_not_go_farther(paper):
    commands = of((50.0,), (49.0,), (51.0,), (0, 0, 65.0))
    joints = Hexaglide().inverse(paper.nominal, paper.branch, commands)
    here = commands[[0]]
    widened = LIMITS.including(Hexaglide(), paper.nominal, here, here, joints[[0]])
    np.testing.assert_array_equal(widened.allow_commands(commands), [True, True, False, False])
    np.testing.assert_array_equal(LIMITS.allow_commands(commands), [False] * 4)


@pytest.mark.parametrize(("beyond", "allowed"), [((50.0,), (44.0,)), ((0, 0, 65.0), (0, 0, 59.0))])
def test_a_robot_that_stands_beyond_a_limit_is_commanded_within_it(paper, beyond, allowed):
    """Its errors turn it from where it is sent; that is no reason to send it beyond the limit."""
    stands, commands = of(beyond), of(allowed, beyond)
    joints = Hexaglide().inverse(paper.nominal, paper.branch, stands)
    widened = LIMITS.including(Hexaglide(), paper.nominal, commands[[0]], stands, joints)
    np.testing.assert_array_equal(widened.allow_commands(commands), [True, False])
    np.testing.assert_array_equal(widened.allow_poses(stands, joints), [True])
    farther = of(tuple(1.01 * angle for angle in beyond))
    np.testing.assert_array_equal(widened.allow_poses(farther, joints), [False])


@pytest.mark.parametrize("tilt", [10.0, 44.0])
def test_limits_stay_as_they_are_for_a_robot_within_them(paper, tilt):
    here = of((tilt,))
    joints = Hexaglide().inverse(paper.nominal, paper.branch, here)
    widened = LIMITS.including(Hexaglide(), paper.nominal, here, here, joints)
    assert (widened.tilt, widened.turn) == (LIMITS.tilt, LIMITS.turn)
    np.testing.assert_array_equal(widened.joint_min, np.full(6, -800.0))
