"""A change of the geometry is measured where frames, and the ball's mounting, do not matter."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.diagnostics.geometry_change import largest_change
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import FrameTransform
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import robots_within_tolerances


@pytest.fixture(scope="module")
def robot(bundled_cell):
    return robot_of(bundled_cell)


def normal(robot, geometry):
    return robot.mechanism.normalize_frames(geometry)[0]


def test_the_same_robot_in_other_frames_has_not_changed(robot) -> None:
    change = FrameTransform(
        rotations.from_vector(np.radians([2.0, 0.0, 0.0])),  # the rails are along x
        np.array([10.0, -20.0, 5.0]),
        rotations.from_vector(np.radians([3.0, -2.0, 1.0])),
    )
    turned = robot.mechanism.change_frames(normal(robot, robot.controller), change)
    assert turned.largest_difference(robot.controller) > 5.0
    assert robot.largest_change(normal(robot, turned)) < 1e-6


def test_one_parameter_that_changes_alone_is_most_of_the_change(robot) -> None:
    vector = robot.controller.vector.copy()
    vector[-1] += 3.0  # the length of a leg, which no frame has a part of
    changed = robot.largest_change(normal(robot, Geometry(robot.controller.parameters, vector)))
    assert changed == pytest.approx(3.0, rel=0.1)


def test_robots_within_their_tolerances_need_no_person(bundled_cell, robot) -> None:
    """In the frames of the convention they differ by up to 37 mm."""
    limit = bundled_cell.settings.acceptance.largest_change_mm
    changes = [robot.largest_change(truth) for truth in robots_within_tolerances(robot, 100, seed=5)]
    assert max(changes) < 0.75 * limit


def test_the_ball_may_be_mounted_elsewhere(robot) -> None:
    parameters = robot.controller.parameters
    away = Geometry(
        parameters, robot.controller.vector + np.array([30.0, -5.0, 12.0]) @ parameters.ball_offset
    )
    allowed = replace(robot.tolerances, ball_mm=40.0)
    before = robot.controller
    assert largest_change(robot.mechanism, before, normal(robot, away), allowed) < 1e-6
    assert largest_change(robot.mechanism, before, normal(robot, away), robot.tolerances) > 5.0


def test_a_geometry_that_is_not_a_number_has_changed(robot) -> None:
    nothing = Geometry(robot.controller.parameters, robot.controller.vector * np.nan)
    assert robot.largest_change(nothing) == float("inf")
