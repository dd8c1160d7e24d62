"""Where commands lead whose controller computes otherwise, and what a refused one says of others."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.commanded_motion import CommandedRobot, RefusedCommand, RefusedCommands
from hexacell.kinematics.pose import Pose, PoseBatch

COMMANDS = PoseBatch.of([Pose(0, 0, 550), Pose(50, -40, 520, 10, -5, 8), Pose(0, 0, 5000)])


@pytest.fixture
def robot(hexaglide, paper):
    return CommandedRobot(hexaglide, paper.branch, paper.nominal, paper.actual)


def test_the_actual_pose_closes_the_geometry_and_leads_back_to_its_command(robot, hexaglide, paper) -> None:
    actual = robot.actual_poses(COMMANDS)
    np.testing.assert_array_equal(actual.found, [True, True, False])
    np.testing.assert_array_equal(actual.joints[:2], robot.joints(COMMANDS)[:2])
    assert np.isnan(actual.joints[2]).any()
    open_by = hexaglide.residual_and_jacobian(paper.actual, actual.poses[:2], actual.joints[:2])[0]
    assert np.abs(open_by).max() < 1e-9
    assert np.abs(actual.poses.positions[:2] - COMMANDS.positions[:2]).max() > 1.0
    actual = robot.actual_poses(COMMANDS[:2])
    commands = robot.commands_for(actual.poses, actual.joints)
    assert commands.found.all()
    np.testing.assert_allclose(commands.poses.positions, COMMANDS.positions[:2], atol=1e-8)
    np.testing.assert_allclose(commands.poses.rotations, COMMANDS.rotations[:2], atol=1e-10)


def test_no_command_is_taken_that_was_refused_or_whose_joints_the_controller_cannot_take(robot) -> None:
    refusing = replace(robot, refused=RefusedCommands((RefusedCommand(COMMANDS.pose(1).as_tuple()),)))
    np.testing.assert_array_equal(refusing.actual_poses(COMMANDS).found, [True, False, False])
    actual = robot.actual_poses(COMMANDS[:1])
    beyond = actual.joints + np.array([400.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not robot.commands_for(actual.poses, beyond).found.any()


POSE = (10.0, -20.0, 550.0, 5.0, -12.0, 40.0)


def moved(column: int, by: float) -> Pose:
    numbers = np.array(POSE)
    numbers[column] += by
    return Pose(*numbers.tolist())


def test_without_an_axis_the_command_itself_is_left_out_and_no_other() -> None:
    refused = RefusedCommands((RefusedCommand(POSE),))
    neighbours = [moved(column, 1e-3) for column in range(6)]
    poses = PoseBatch.of([Pose(*POSE), *neighbours])
    assert refused.allow(poses).tolist() == [False, *[True] * 6]
    assert not refused.allows(POSE)


@pytest.mark.parametrize("column", range(6))
@pytest.mark.parametrize("is_highest", [True, False])
def test_beyond_the_limit_of_an_axis_all_that_is_as_far_out_is_left_out(column, is_highest) -> None:
    refused = RefusedCommands((RefusedCommand(POSE, "xyzabc"[column], is_highest),))
    outward = 1.0 if is_highest else -1.0
    assert not refused.allows(POSE)
    assert not refused.allows(moved(column, 2.0 * outward).as_tuple())
    assert refused.allows(moved(column, -0.01 * outward).as_tuple())
    inward = np.array(moved(column, -0.01 * outward).as_tuple())
    inward[(column + 1) % 6] += 3.0
    assert refused.allows(Pose(*inward.tolist()).as_tuple()), "other axes are not concerned"


def test_every_refusal_counts() -> None:
    refused = RefusedCommands(
        (RefusedCommand(POSE, "c", is_highest=True), RefusedCommand(POSE, "a", is_highest=False))
    )
    level = Pose(0.0, 0.0, 550.0, 6.0)
    poses = PoseBatch.of([level, Pose(0.0, 0.0, 550.0, 4.0), Pose(0.0, 0.0, 550.0, 6.0, 0.0, 41.0)])
    assert refused.allow(poses).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("by_mm", "by_deg", "is_near"), [(29.0, 4.9, True), (31.0, 0.0, False), (0.0, 5.1, False)]
)
def test_what_is_near_a_command_that_was_taken_out_is_left_out(by_mm, by_deg, is_near) -> None:
    refused = RefusedCommands((RefusedCommand(POSE, within_mm=30.0, within_deg=5.0),))
    x, y, z, a, b, c = POSE
    assert refused.allows((x, y, z + by_mm, a, b, c + by_deg)) is not is_near
    assert not refused.allows(POSE)
