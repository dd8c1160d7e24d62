"""Where a robot goes when its controller computes with another geometry, and back."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.commanded_motion import CommandedRobot, RefusedCommand, RefusedCommands
from hexacell.kinematics.pose import Pose, PoseBatch

COMMANDS = PoseBatch.of([Pose(0, 0, 550), Pose(50, -40, 520, 10, -5, 8), Pose(0, 0, 5000)])


@pytest.fixture
def robot(hexaglide, paper):
    return CommandedRobot(hexaglide, paper.branch, paper.nominal, paper.actual)


def test_the_actual_pose_closes_the_actual_geometry_at_the_joints_of_the_command(robot, hexaglide, paper):
    actual = robot.actual_poses(COMMANDS)
    np.testing.assert_array_equal(actual.found, [True, True, False])
    np.testing.assert_array_equal(actual.joints[:2], robot.joints(COMMANDS)[:2])
    assert np.isnan(actual.joints[2]).any()
    open_by = hexaglide.residual_and_jacobian(paper.actual, actual.poses[:2], actual.joints[:2])[0]
    assert np.abs(open_by).max() < 1e-9
    assert np.abs(actual.poses.positions[:2] - COMMANDS.positions[:2]).max() > 1.0


def test_the_command_computed_for_an_actual_pose_is_the_original_command(robot):
    actual = robot.actual_poses(COMMANDS[:2])
    commands = robot.commands_for(actual.poses, actual.joints)
    assert commands.found.all()
    np.testing.assert_allclose(commands.poses.positions, COMMANDS.positions[:2], atol=1e-8)
    np.testing.assert_allclose(commands.poses.rotations, COMMANDS.rotations[:2], atol=1e-10)


def test_a_refused_command_is_not_taken(robot):
    refusing = replace(robot, refused=RefusedCommands((RefusedCommand(COMMANDS.pose(1).as_tuple()),)))
    np.testing.assert_array_equal(refusing.actual_poses(COMMANDS).found, [True, False, False])


def test_no_command_leads_to_joints_that_the_controllers_geometry_cannot_take(robot):
    actual = robot.actual_poses(COMMANDS[:1])
    beyond = actual.joints + np.array([400.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not robot.commands_for(actual.poses, beyond).found.any()
