"""Compiled loops give what numpy's give: poses, margins, distances, limits of legs, and whole decisions."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.compiled.availability import VARIABLE
from hexacell.kinematics.forward import LARGEST_CONTRACTION, continue_solution, forward_kinematics, modes_of
from hexacell.kinematics.free_sensitivity import POSE, POSITION, free_sensitivity, sensitivity_and_margin
from hexacell.kinematics.geometry import GeometryBatch
from hexacell.kinematics.leg_closure import closure_to_compile
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import (
    inverse_and_mode,
    margin_and_mode,
    pose_sensitivity,
    position_sensitivity,
    singularity_margin,
)
from hexacell.limits.leg_limits import LegLimits
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import random_robot
from tests.compiled_loops import compiled

pytest.importorskip("numba")

CELLS = ("simulated-hexaglide", "linapod", "gough-stewart", "rotary-cranks")


def both(work):
    """What some work returns with numpy, and compiled."""
    with compiled(False):
        by_numpy = work()
    with compiled(True):
        return by_numpy, work()


@pytest.fixture(scope="module", params=CELLS)
def cell(request):
    """A robot, another geometry of each of many poses near its first point, and joint variables there."""
    loaded = load_cell(bundled_config(request.param))
    robot, random = robot_of(loaded), np.random.default_rng(7)
    nominal = robot.commanding
    at = Pose(*loaded.settings.identification.points[0])
    turns = random.uniform(-15.0, 15.0, (40, 3))
    poses = robot.from_commands(Pose(at.x, at.y, at.z, *turn) for turn in turns)
    joints = robot.mechanism.inverse(nominal, robot.branch, poses)
    kept = np.asarray(np.isfinite(joints).all(axis=-1))
    assert kept.sum() > 20
    count = int(kept.sum())
    errors = [
        random_robot(robot.mechanism, robot.drawing, robot.tolerances, random).vector for _ in range(count)
    ]
    return robot, nominal, GeometryBatch(nominal.parameters, np.array(errors)), poses[kept], joints[kept]


def assert_same_poses(one, other):
    np.testing.assert_array_equal(one.found, other.found)
    assert one.found.any()
    rows = one.found
    np.testing.assert_allclose(one.poses.positions[rows], other.poses.positions[rows], atol=1e-8)
    np.testing.assert_allclose(one.poses.rotations[rows], other.poses.rotations[rows], atol=1e-10)


def test_there_is_something_to_compile(cell):
    robot, nominal, _, _, joints = cell
    with compiled(True):
        assert closure_to_compile(robot.mechanism, nominal, joints) is not None
    with compiled(False):
        assert closure_to_compile(robot.mechanism, nominal, joints) is None


@pytest.mark.parametrize("contraction", [np.inf, LARGEST_CONTRACTION, 0.01])
def test_newton_finds_the_same_poses_and_refuses_the_same(cell, contraction):
    robot, nominal, _, poses, joints = cell
    start = PoseBatch(poses.positions + np.array([4.0, -3.0, 5.0]), np.tile(np.eye(3), (len(poses), 1, 1)))
    by_numpy, by_loops = both(
        lambda: forward_kinematics(robot.mechanism, nominal, joints, start, largest_contraction=contraction)
    )
    np.testing.assert_array_equal(by_numpy.found, by_loops.found)
    if by_numpy.found.any():
        assert_same_poses(by_numpy, by_loops)


def test_of_many_geometries_each_has_its_own_pose(cell):
    robot, nominal, robots, poses, joints = cell
    by_numpy, by_loops = both(
        lambda: continue_solution(
            robot.mechanism, robots, joints, start=poses, start_geometry=nominal, start_joints=joints
        )
    )
    assert_same_poses(by_numpy, by_loops)
    with compiled(False):
        error, _ = robot.mechanism.residual_and_jacobian(robots, by_loops.poses, joints)
    assert np.abs(error[by_loops.found]).max() < 1e-9


def test_joints_that_no_pose_has_are_not_found_and_harm_no_other(cell):
    robot, nominal, _, poses, joints = cell
    broken = joints.copy()
    broken[3] += 5090.0 * np.array([1, -1, 1, -1, 1, -1])
    by_numpy, by_loops = both(lambda: forward_kinematics(robot.mechanism, nominal, broken, poses))
    assert_same_poses(by_numpy, by_loops)
    assert not by_loops.found[3]
    assert by_loops.found.sum() == len(poses) - 1


@pytest.mark.parametrize("share", [0.2, 0.999999, 1.000001, 3.0])
def test_margins_are_decided_alike_near_the_limit_too(cell, share):
    robot, nominal, robots, poses, joints = cell
    least = share * float(np.median(singularity_margin(robot.mechanism, nominal, poses, joints)))
    for geometry in (nominal, robots):
        by_numpy, by_loops = both(
            lambda geometry=geometry: margin_and_mode(robot.mechanism, geometry, poses, joints, least)
        )
        np.testing.assert_array_equal(by_numpy[0], by_loops[0])
        np.testing.assert_array_equal(by_numpy[1], by_loops[1])


def test_poses_depend_alike_on_joints_and_parameters(cell):
    robot, nominal, _, poses, joints = cell
    by_numpy, by_loops = both(lambda: pose_sensitivity(robot.mechanism, nominal, poses, joints))
    np.testing.assert_array_equal(by_numpy.mode, by_loops.mode)
    largest = np.abs(by_numpy.parameters).max()
    np.testing.assert_allclose(by_numpy.parameters, by_loops.parameters, atol=1e-9 * largest)
    np.testing.assert_allclose(by_numpy.joints, by_loops.joints, atol=1e-9 * largest)
    by_numpy, by_loops = both(lambda: position_sensitivity(robot.mechanism, nominal, poses, joints)[0])
    np.testing.assert_allclose(by_numpy, by_loops, atol=1e-9 * largest)


@pytest.mark.parametrize("coordinates", [POSITION, POSE])
def test_poses_depend_alike_on_free_parameters(cell, coordinates):
    robot, nominal, _, poses, joints = cell
    at = robot.mechanism, nominal, poses, joints
    for few in (40, 1, 0):
        some = robot.mechanism, nominal, poses[:few], joints[:few], coordinates
        by_numpy, by_loops = both(lambda some=some: free_sensitivity(*some))
        np.testing.assert_array_equal(by_numpy.mode, by_loops.mode)
        largest = np.abs(by_numpy.free).max(initial=1.0)
        np.testing.assert_allclose(by_numpy.free, by_loops.free, atol=1e-9 * largest)
        np.testing.assert_allclose(by_numpy.joints, by_loops.joints, atol=1e-9 * largest)
    with compiled(False):
        found, every = free_sensitivity(*at, coordinates), pose_sensitivity(*at)
    by_basis = every.parameters[:, :coordinates] @ robot.mechanism.convention.basis()
    np.testing.assert_allclose(found.free, by_basis, atol=1e-12 * np.abs(by_basis).max())
    np.testing.assert_array_equal(found.joints, every.joints[:, :coordinates])


@pytest.mark.parametrize("share", [0.2, 0.999999, 1.000001, 3.0])
def test_margins_beside_sensitivities_are_those_of_the_poses(cell, share):
    robot, nominal, _, poses, joints = cell
    least = share * float(np.median(singularity_margin(robot.mechanism, nominal, poses, joints)))
    at = robot.mechanism, nominal, poses, joints
    with compiled(False):
        wanted, expected = margin_and_mode(*at, least)[0], free_sensitivity(*at, POSITION)
    for found, has_margin in both(lambda: sensitivity_and_margin(*at, POSITION, least)):
        np.testing.assert_array_equal(has_margin, wanted)
        np.testing.assert_array_equal(found.mode, expected.mode)
        np.testing.assert_allclose(found.free, expected.free, atol=1e-9 * np.abs(expected.free).max())
        np.testing.assert_allclose(found.joints, expected.joints, atol=1e-9 * np.abs(expected.joints).max())


def test_exactly_at_a_singularity_there_is_no_margin_and_the_others_have_theirs(cell, monkeypatch):
    robot, nominal, _, poses, joints = cell
    linear = robot.mechanism.derivatives(nominal, poses, joints)
    linear.pose[2] = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    monkeypatch.setattr(type(robot.mechanism), "derivatives", lambda *_: linear)
    at = robot.mechanism, nominal, poses, joints, POSITION
    least = 0.2 * float(np.median(singularity_margin(*at[:4])))
    for found, has_margin in both(lambda: sensitivity_and_margin(*at, least)):
        assert not has_margin[2]
        assert has_margin[:2].any()
        assert np.isfinite(found.free).all()


def test_joints_and_derivatives_of_constraints_are_the_same_and_nan_out_of_reach(cell):
    robot, nominal, _, poses, joints = cell
    far = poses.with_rows([2], PoseBatch(poses.positions[[2]] + 9000.0, poses.rotations[[2]]))
    by_numpy, by_loops = both(lambda: robot.mechanism.inverse(nominal, robot.branch, far))
    np.testing.assert_array_equal(np.isnan(by_numpy), np.isnan(by_loops))
    np.testing.assert_allclose(by_numpy, by_loops, rtol=1e-12)
    by_numpy, by_loops = both(lambda: robot.mechanism.derivatives(nominal, poses, joints))
    for name in ("pose", "joints", "parameters"):
        one, other = getattr(by_numpy, name), getattr(by_loops, name)
        np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(one).max())


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.3])
def test_limits_by_what_closes_the_legs_are_those_by_the_legs(cell, turn):
    """The least margins, and cones that are narrower than nothing or wider than everything."""
    robot, nominal, robots, poses, joints = cell
    legs = robot.mechanism.legs(nominal, poses, joints)
    toward = legs.directions_in_carriers[0], legs.directions_in_platform[0]
    cones = np.array([0.3, 0.35, 0.3, 0.35, 0.3, 4.0]), np.array([0.3, 0.3, 0.25, 0.3, 3.2, 0.35])
    with compiled(False):
        near = float(np.quantile(legs.smallest_distance(), 0.2))
    limits = replace(robot.limits, legs=LegLimits(*toward, *cones, near - 1.0))
    wanted = limits.legs.margins_for(turn, 100.0)
    for geometry in (nominal, robots):
        at = robot.mechanism, geometry, poses, joints
        np.testing.assert_array_equal(*both(lambda at=at: limits.allow_legs(*at, wanted)))
        by_numpy, by_loops = both(lambda at=at: limits.leg_margins(*at))
        np.testing.assert_allclose(by_numpy, by_loops, atol=1e-7)
    unreachable = joints.copy()
    unreachable[1] = np.nan
    at = robot.mechanism, nominal, poses, unreachable
    np.testing.assert_array_equal(*both(lambda: limits.allow_legs(*at, wanted)))


def test_an_exact_singularity_is_told_alike():
    jacobians = np.stack([np.eye(6), np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])])
    for is_on in (False, True):
        with compiled(is_on), pytest.raises(np.linalg.LinAlgError):
            inverse_and_mode(jacobians)


def test_assembly_modes_are_the_same(cell):
    robot, nominal, robots, poses, joints = cell
    for geometry in (nominal, robots):
        modes = both(lambda geometry=geometry: modes_of(robot.mechanism, geometry, poses, joints))
        np.testing.assert_array_equal(*modes)


@pytest.mark.parametrize("has_distance", [False, True])
def test_legs_keep_the_same_limits(cell, has_distance):
    robot, nominal, _, poses, joints = cell
    legs = robot.mechanism.legs(nominal, poses, joints)
    by_numpy, by_loops = both(legs.smallest_distance)
    np.testing.assert_allclose(by_numpy, by_loops, rtol=1e-12)
    distance = float(np.quantile(by_numpy, 0.2)) - 1.0 if has_distance else 0.0
    toward = legs.directions_in_carriers[0], legs.directions_in_platform[0]
    limits = LegLimits(*toward, np.full(6, 0.3), np.full(6, 0.35), distance)
    wanted = limits.margins_for(0.01, 100.0)
    by_numpy, by_loops = both(lambda: limits.keeps(legs, wanted))
    np.testing.assert_array_equal(by_numpy, by_loops)
    assert by_numpy.any()
    assert not by_numpy.all()
    # Angles near zero are known to the root of the rounding of their cosines.
    by_numpy, by_loops = both(lambda: limits.margins(legs))
    np.testing.assert_allclose(by_numpy, by_loops, atol=1e-7)


def test_a_decision_is_the_same_in_a_program_of_its_own():
    """As installed with the extra and without: the pose that a fresh process chooses."""
    shown = [
        subprocess.run(
            [sys.executable, "-c", DECISION],
            env={**os.environ, VARIABLE: wanted},
            check=True,
            capture_output=True,
            text=True,
        ).stdout.split()
        for wanted in ("no", "yes")
    ]
    assert [shown[0][0], shown[1][0]] == ["False", "True"]
    by_numpy, by_loops = ([float(number) for number in one[1:]] for one in shown)
    np.testing.assert_allclose(by_numpy, by_loops, atol=1e-6)


DECISION = """
import numpy as np
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.compiled.availability import is_compiled
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot

cell = load_cell(bundled_config("simulated-hexaglide"))
robot = robot_of(cell)
virtual = VirtualRobot(robot, robot.drawing, np.random.default_rng(3))
campaign = VirtualCampaign(Plan(cell.settings, robot, with_forecast=False, candidates=256), virtual)
while len(campaign.measurements) < 4:
    campaign.step()
print(is_compiled(), *campaign.state.present.as_tuple())
"""
