"""What is drawn is the robot: its legs close, drives are where its numbers say, gauges on their sides."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.drawing.robot_scene import crank_centres, robot_scene
from hexacell.drawing.shapes import AXIS_ROLES, Form, Role, Scene, arrows, enlargement
from hexacell.errors import ReachError
from hexacell.kinematics.pose import Pose


def lines(scene: Scene, role: Role, form: Form = Form.LINE) -> list[np.ndarray]:
    return [one.points for one in scene if (one.role, one.form) == (role, form)]


def balls(scene: Scene, role: Role) -> np.ndarray:
    return np.concatenate(lines(scene, role, Form.BALL))


def test_every_robot_has_numbered_legs_from_its_drives_to_its_platform(any_robot) -> None:
    scene, pose = any_robot.scene, any_robot.pose
    legs = lines(scene, Role.LEG)
    numbers = [one for one in scene if one.form is Form.WORD and one.role is Role.LEG]
    count = any_robot.robot.mechanism.joint_count
    assert [one.text for one in numbers] == list("123456"[:count])
    for leg, number, drive, joint in zip(
        legs, numbers, balls(scene, Role.DRIVE), balls(scene, Role.PLATFORM), strict=True
    ):
        assert np.allclose(leg, [drive, joint])
        apart = [np.linalg.norm(number.points[0] - end) for end in leg]
        assert sum(apart) == pytest.approx(np.linalg.norm(leg[1] - leg[0]))
    assert np.allclose(balls(scene, Role.BALL), pose.position)
    assert all(np.isfinite(one.points).all() for one in scene)
    assert lines(scene, Role.BASE, Form.SURFACE)


def test_legs_of_fixed_length_have_the_length_of_the_geometry_and_sliders_are_on_rails(hexaglide) -> None:
    scene, geometry = hexaglide.scene, hexaglide.robot.geometry
    lengths = [np.linalg.norm(leg[1] - leg[0]) for leg in lines(scene, Role.LEG)]
    assert lengths == pytest.approx(geometry["l"].tolist())
    for rail, slider, joint in zip(
        lines(scene, Role.RAIL), balls(scene, Role.DRIVE), geometry["S"], strict=True
    ):
        assert np.allclose(rail[:, 1:], joint[1:])  # along x
        assert rail[0, 0] < slider[0] < rail[-1, 0]


def test_cranks_turn_about_their_centres(cranks) -> None:
    geometry = cranks.robot.geometry
    assert np.allclose(crank_centres(cranks.robot.tracks(cranks.pose)), geometry["centre"])
    drives = lines(cranks.scene, Role.DRIVE)
    cranks_drawn = [line for line in drives if np.isclose(line[0], geometry["centre"]).all(axis=1).any()]
    assert [np.linalg.norm(end - start) for start, end in cranks_drawn] == pytest.approx(
        geometry["crank"].tolist()
    )


def test_another_branch_or_swapped_legs_are_seen(hexaglide) -> None:
    robot, pose = hexaglide.robot, hexaglide.pose
    before = balls(hexaglide.scene, Role.DRIVE)
    mirrored = replace(robot, branch=(-robot.branch[0], *robot.branch[1:]))
    moved = np.linalg.norm(balls(robot_scene(mirrored, pose), Role.DRIVE) - before, axis=-1)
    assert (moved > 100.0).tolist() == [True, *[False] * 5]
    order = [1, 0, 2, 3, 4, 5]
    values = {symbol: robot.geometry[symbol] for symbol in robot.mechanism.parameters.shapes}
    swapped = type(robot.geometry).of(
        robot.mechanism.parameters, values | {"B": robot.geometry["B"][order]}
    )
    joints = balls(robot_scene(replace(robot, geometry=swapped), pose), Role.PLATFORM)
    assert np.allclose(joints, balls(hexaglide.scene, Role.PLATFORM)[order])


def test_gauges_are_on_the_side_that_their_signs_say(hexaglide) -> None:
    robot, pose = replace(hexaglide.robot, gauge_signs=(1, -1, 1)), hexaglide.pose
    for axis, (role, sign) in enumerate(zip(AXIS_ROLES, (1, -1, 1), strict=True)):
        away = np.concatenate(lines(robot_scene(robot, pose), role)) - pose.position
        assert (sign * away[:, axis] > 0.0).all()
        assert np.allclose(np.delete(away, axis, axis=1), 0.0)


def test_a_pose_out_of_reach_is_refused(hexaglide) -> None:
    with pytest.raises(ReachError, match="leg 1 cannot reach"):
        robot_scene(hexaglide.robot, Pose(0.0, 0.0, 5000.0))


def test_errors_are_enlarged_by_a_round_factor_that_keeps_them_short() -> None:
    vectors = np.array([[0.3, 0.0, 0.0], [0.0, 0.04, 0.0]])
    assert enlargement([vectors, 0.1 * vectors], 100.0) == 200.0
    assert enlargement([vectors], 0.1) == 1.0
    assert enlargement([np.zeros((1, 3))], 100.0) == enlargement([], 100.0) == 1.0
    starts = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    ends = [line[1] for line in lines(arrows(Role.AFTER, starts, vectors), Role.AFTER, Form.ARROW)]
    assert np.allclose(ends, starts + vectors)
