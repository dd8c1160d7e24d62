"""Robots with four and five joints: poses that they take, and derivatives by what their legs share."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import free_sensitivity
from hexacell.robot.model import Robot, robot_of

NAMES = ("five-legs", "four-arms")
tilt = st.floats(-50.0, 50.0)


@cache
def robot(name: str) -> Robot:
    return robot_of(load_cell(bundled_config(name)))


def with_skew(skew: float) -> tuple[Mechanism, Geometry]:
    drawn = robot("five-legs").drawing
    return robot("five-legs").mechanism, Geometry.of(drawn.parameters, drawn.document() | {"skew": [skew]})


@given(tilt, tilt, tilt)
def test_a_five_legged_machine_turns_as_its_tilts_make_it(a: float, b: float, c: float) -> None:
    """The closed form tan c = sin b tan a; place and tilts are as they were."""
    mechanism, geometry = with_skew(0.0)
    pose = mechanism.completed(geometry, PoseBatch.of([Pose(10.0, -20.0, 700.0, a, b, c)])).pose(0)
    assert pose.as_tuple()[:5] == pytest.approx((10.0, -20.0, 700.0, a, b), abs=1e-9)
    assert np.tan(np.radians(pose.c)) == pytest.approx(
        np.sin(np.radians(b)) * np.tan(np.radians(a)), abs=1e-9
    )


@given(tilt, tilt, st.floats(-0.05, 0.05))
def test_the_passive_leg_holds_its_axes_at_the_angle_that_it_has(a: float, b: float, skew: float) -> None:
    mechanism, geometry = with_skew(skew)
    pose = mechanism.completed(geometry, PoseBatch.of([Pose(0.0, 0.0, 700.0, a, b)]))
    assert np.arcsin(pose.rotations[0, 0, 1]) == pytest.approx(skew, abs=1e-10)
    assert mechanism.completed(geometry, pose) is pose, "it has nothing to complete"


@given(tilt, tilt, tilt)
def test_a_four_armed_robot_does_not_tilt(a: float, b: float, c: float) -> None:
    one = robot("four-arms")
    pose = one.mechanism.completed(one.drawing, PoseBatch.of([Pose(5.0, 6.0, 7.0, a, b, c)])).pose(0)
    assert pose.as_tuple() == pytest.approx((5.0, 6.0, 7.0, 0.0, 0.0, c), abs=1e-9)


def test_a_robot_with_six_joints_takes_every_pose() -> None:
    one = robot("gough-stewart")
    poses = PoseBatch.of([Pose(1.0, 2.0, 700.0, 10.0, -20.0, 30.0)])
    assert one.mechanism.completed(one.drawing, poses) is poses
    assert one.mechanism.joint_count == 6


def free_numbers(one: Robot) -> tuple[Array, PoseBatch, Array]:
    """Free parameters of a robot, poses that it takes, and its joints there."""
    free = one.mechanism.convention.free_parameters(one.commanding)
    points = load_cell(bundled_config(one.mechanism.name)).settings.task.poses
    poses = one.from_commands(Pose(*pose) for pose in points)
    return free, poses, one.mechanism.inverse(one.commanding, one.branch, poses)


@pytest.mark.parametrize("name", NAMES)
def test_sensitivities_are_those_of_the_forward_kinematics(name: str) -> None:
    """By what legs share too: the pose with each free parameter changed, the joints as they are."""
    from hexacell.kinematics.forward import forward_kinematics

    one = robot(name)
    free, poses, joints = free_numbers(one)
    mechanism, convention = one.mechanism, one.mechanism.convention
    found = free_sensitivity(mechanism, one.commanding, poses, joints)
    assert found.joints.shape[-1] == mechanism.joint_count
    steps = 1e-4 * np.eye(len(free)) * np.where(np.char.find(convention.free_names, "rail") >= 0, 1e-2, 1.0)
    for column, step in enumerate(steps):
        ends = [
            forward_kinematics(mechanism, convention.geometry(free + sign * step), joints, poses).poses
            for sign in (1.0, -1.0)
        ]
        moved = (ends[0].positions - ends[1].positions) / (2.0 * step[column])
        turned = rotations.to_vector(ends[0].rotations @ np.swapaxes(ends[1].rotations, -1, -2))
        by_difference = np.concatenate([moved, turned / (2.0 * step[column])], axis=-1)
        np.testing.assert_allclose(found.free[..., column], by_difference, rtol=1e-5, atol=1e-5)
