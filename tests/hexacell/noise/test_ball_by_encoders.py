"""What encoders say of the ball holds for every robot within the tolerances, as surely as stated."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.noise.allowances import Allowances
from hexacell.noise.ball_by_encoders import BallByEncoders
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances

REFERENCE = Pose(0.0, 0.0, 550.0)


@pytest.fixture(scope="module")
def robot(bundled_cell):
    return robot_of(bundled_cell)


def drawn(robot, count, seed):
    """Robots within the tolerances that can take the reference."""
    command = robot.from_commands([REFERENCE])
    every = robots_within_tolerances(robot, count, seed=seed)
    return [truth for truth in every if VirtualRobot(robot, truth).can_stand(command)[0]]


def moved(robot, truth, changes) -> np.ndarray:
    """How the ball of a robot moves (n, 3), along the base, as its joints stop beside their commands."""
    at = VirtualRobot(robot, truth).actual_poses(robot.from_commands([REFERENCE]))
    joints = np.concatenate([at.joints, at.joints + changes])
    start = PoseBatch.joined([at.poses] * len(joints))
    found = forward_kinematics(robot.mechanism, truth, joints, start)
    assert found.found.all()
    positions = found.poses.positions
    return np.asarray((positions[1:] - positions[0]) @ robot.frames.base)


@pytest.mark.parametrize("stops", [0.05, 0.5])
def test_what_is_not_known_of_the_geometry_explains_the_difference(robot, stops) -> None:
    ball = BallByEncoders.at(robot, robot.belief(), robot.from_commands([REFERENCE]))
    random, squares = np.random.default_rng(5), []
    for truth in drawn(robot, 60, seed=3):
        changes = stops * random.standard_normal((4, 6))
        rest = moved(robot, truth, changes) - ball.motion(changes)
        known = zip(rest, ball.covariance(changes), strict=True)
        squares += [one @ np.linalg.solve(covariance, one) for one, covariance in known]
    assert np.median(squares) == pytest.approx(2.37, rel=0.4), "of three coordinates"
    assert np.mean(np.array(squares) < 3.0 * 25.0) > 0.98, "five standard deviations"
    size = np.linalg.norm(moved(robot, truth, changes), axis=1).mean()
    assert np.linalg.norm(rest, axis=1).mean() < 0.3 * size, "most of it is explained"


def test_the_reference_of_another_robot_is_no_drift(bundled_cell, robot) -> None:
    """Both readings are of a machine that stops 0.2 mm beside its commands, and is not as drawn."""
    random, allowances = np.random.default_rng(6), Allowances(bundled_cell.settings, robot)
    for truth in drawn(robot, 40, seed=8):
        change = 0.2 * random.standard_normal((1, 6))
        after = np.concatenate([moved(robot, truth, change)[0], change[0]])
        found = allowances.since(REFERENCE, np.zeros(9), after)
        assert not found.exceeds(0.1)
    slipped = allowances.since(REFERENCE, np.zeros(9), after + np.eye(9)[1])
    assert slipped.exceeds(0.1)


def test_it_is_there_where_the_encoders_show_it_whatever_commanded_it(robot) -> None:
    """While points are measured a provisional geometry may command, and bring the ball elsewhere."""
    [truth] = drawn(robot, 1, seed=3)
    provisional = robot.with_controller(robot.for_controller(truth))
    known = replace(robot.belief(), free=robot.mechanism.convention.free_parameters(truth))
    changes = 0.1 * np.random.default_rng(7).standard_normal((20, 6))
    really = moved(provisional, truth, changes)
    joints = robot.mechanism.inverse(truth, robot.branch, provisional.from_commands([REFERENCE]))[0]
    for shown, is_known in ((joints, True), (None, False)):
        ball = BallByEncoders.at(robot, known, robot.from_commands([REFERENCE]), shown)
        assert (np.abs(ball.motion(changes) - really).max() < 0.01) == is_known
