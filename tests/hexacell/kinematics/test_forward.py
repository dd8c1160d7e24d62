"""Newton's method and continuation against kinematics written for the tests alone."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics.forward import continue_solution, forward_kinematics
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import singularity_margin
from tests.hexacell.conftest import vector
from tests.hexacell.kinematics.numeric import MARGIN, POSES, numeric_jacobian, turned_about

SMALL = st.floats(-1.0, 1.0)
NUDGES = st.tuples(SMALL, SMALL, SMALL, SMALL, SMALL, SMALL)
GEOMETRY_ERRORS = st.lists(st.floats(-7.0, 7.0), min_size=35, max_size=35)


def nudged(pose: Pose, by) -> PoseBatch:
    """Beside a pose by up to 10 mm and 0.1 rad on each axis."""
    turn = Rotation.from_rotvec(0.1 * np.array(by[3:])).as_matrix()
    return PoseBatch((pose.position + 10.0 * np.array(by[:3]))[None], (turn @ pose.rotation)[None])


@given(POSES, NUDGES)
def test_forward_undoes_inverse(hexaglide, paper, legs, pose, by):
    joints = legs(paper.actual).joints(vector(pose))
    assume(not np.isnan(joints).any())
    assume(legs(paper.actual).margin(joints, vector(pose)) > MARGIN)
    found = forward_kinematics(hexaglide, paper.actual, joints[None], nudged(pose, by))
    assert found.found[0]
    np.testing.assert_allclose(found.poses.positions[0], pose.position, atol=1e-8)
    np.testing.assert_allclose(found.poses.rotations[0], pose.rotation, atol=1e-10)


def clear_between(hexaglide, first, second, start, joints, steps=16):
    """Whether small steps from one geometry to another keep clear of singularities.

    Where they do not, the pose under the second geometry may be that of another branch of solutions.
    """
    poses = start
    for step in range(steps + 1):
        geometry = second.interpolate_from(first, step / steps)
        result = forward_kinematics(hexaglide, geometry, joints, poses)
        if (
            not result.found[0]
            or singularity_margin(hexaglide, geometry, result.poses, joints)[0] <= MARGIN
        ):
            return False
        poses = result.poses
    return True


@given(POSES, GEOMETRY_ERRORS)
def test_continuation_to_another_geometry_and_back_is_the_identity(hexaglide, paper, pose, errors):
    built = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + hexaglide.convention.basis @ errors)
    at = PoseBatch.of([pose])
    joints = hexaglide.inverse(paper.nominal, paper.branch, at)
    assume(not np.isnan(joints).any())
    there = continue_solution(
        hexaglide, built, joints, start=at, start_geometry=paper.nominal, start_joints=joints
    )
    assume(there.found[0])
    # A pose out here belongs to the same branch unless a leg went through upright.
    assume((hexaglide.branch(built, there.poses, joints) == paper.branch).all())
    np.testing.assert_allclose(hexaglide.inverse(built, paper.branch, there.poses), joints, atol=1e-7)
    assume(clear_between(hexaglide, paper.nominal, built, at, joints))
    back = continue_solution(
        hexaglide, paper.nominal, joints, start=there.poses, start_geometry=built, start_joints=joints
    )
    assert back.found[0]
    np.testing.assert_allclose(back.poses.positions, at.positions, atol=1e-7)
    np.testing.assert_allclose(back.poses.rotations, at.rotations, atol=1e-9)


@pytest.mark.parametrize("seed", [0, 2])
def test_continuation_agrees_with_small_geometry_steps(hexaglide, paper, visit, seed):
    """A whole data set at once, some of it next to singularities."""
    seen = visit(seed=seed)
    found = continue_solution(
        hexaglide,
        paper.actual,
        seen.joints,
        start=PoseBatch.of(seen.commands),
        start_geometry=paper.nominal,
        start_joints=seen.joints,
    )
    assert found.found.all()
    np.testing.assert_allclose(found.poses.positions, seen.balls, atol=1e-7)
    np.testing.assert_allclose(found.poses.rotations, seen.rotations, atol=1e-9)


def test_continuation_changes_joints_and_geometry_together(hexaglide, paper, inverse):
    start, end = PoseBatch.of([Pose(0, 0, 550)]), PoseBatch.of([Pose(40, -60, 500, 15, -10, 20)])
    found = continue_solution(
        hexaglide,
        paper.actual,
        inverse(paper.actual, end),
        start=start,
        start_geometry=paper.nominal,
        start_joints=inverse(paper.nominal, start),
    )
    assert found.found[0]
    np.testing.assert_allclose(found.poses.positions, end.positions, atol=1e-8)
    np.testing.assert_allclose(found.poses.rotations, end.rotations, atol=1e-10)


def test_empty_batches(hexaglide, paper):
    nothing, none = PoseBatch.of([]), np.empty((0, 6))
    found = continue_solution(
        hexaglide, paper.actual, none, start=nothing, start_geometry=paper.nominal, start_joints=none
    )
    assert len(found.poses) == 0
    assert found.found.shape == (0,)
    assert len(forward_kinematics(hexaglide, paper.actual, none, nothing).poses) == 0
    assert singularity_margin(hexaglide, paper.actual, nothing, none).shape == (0,)


def found_either_way(mechanism, geometry, joints, near, starts, start_joints):
    """By the pose they are near to, and by a path from others that close."""
    yield forward_kinematics(mechanism, geometry, joints, near)
    start = {"start": starts, "start_geometry": geometry, "start_joints": start_joints}
    yield continue_solution(mechanism, geometry, joints, **start)


def test_joints_without_a_solution_do_not_affect_other_poses(hexaglide, paper, inverse):
    at = PoseBatch.of([Pose(0, 0, 550, 5), Pose(10, 20, 560), Pose(0, 0, 540)])
    joints = inverse(paper.nominal, at)
    joints[1] += [-300, -300, -300, 300, 300, 300]
    near = nudged(Pose(0, 0, 550), [0.1] * 6)[[0, 0, 0]]
    for found in found_either_way(hexaglide, paper.nominal, joints, near, at, inverse(paper.nominal, at)):
        np.testing.assert_array_equal(found.found, [True, False, True])
        np.testing.assert_allclose(found.poses.positions[[0, 2]], at.positions[[0, 2]], atol=1e-8)


@pytest.mark.parametrize("axis", ["a", "b", "c"])
def test_solutions_beyond_a_singularity_are_not_found(hexaglide, paper, inverse, axis):
    """Joint variables of poses beyond: either a pose on this side has them too, or none is found."""
    here = PoseBatch.of([turned_about(axis, 25.0)])
    beyond = PoseBatch.of([turned_about(axis, angle) for angle in np.arange(25.0, 66.0, 0.5)])
    joints = hexaglide.inverse(paper.nominal, paper.branch, beyond)
    joints = joints[~np.isnan(joints).any(axis=1)]
    starts = here[[0] * len(joints)]
    side = np.sign(
        np.linalg.det(numeric_jacobian(hexaglide, paper.nominal, here, inverse(paper.nominal, here)))
    )
    at_start = inverse(paper.nominal, starts)
    for found in found_either_way(hexaglide, paper.nominal, joints, starts, starts, at_start):
        rows = np.flatnonzero(found.found)
        assert len(rows) >= 10
        for row in rows.tolist():
            end, at = found.poses[[row]], joints[[row]]
            np.testing.assert_allclose(
                hexaglide.residual_and_jacobian(paper.nominal, end, at)[0], 0.0, atol=1e-8
            )
            assert np.sign(np.linalg.det(numeric_jacobian(hexaglide, paper.nominal, end, at))) == side


def test_batched_geometries_agree_with_single_ones(hexaglide, paper, inverse):
    random = np.random.default_rng(3)
    at = PoseBatch.of([Pose(0, 0, 550, 5 * k, -3 * k, 8 * k) for k in range(4)])
    joints = inverse(paper.nominal, at)
    robots = [
        Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + random.normal(0, 1, 42)) for _ in range(4)
    ]
    together = GeometryBatch(HEXAGLIDE_PARAMETERS, np.array([robot.vector for robot in robots]))
    found = forward_kinematics(hexaglide, together, joints, at)
    assert found.found.all()
    for row, robot in enumerate(robots):
        alone = forward_kinematics(hexaglide, robot, joints[[row]], at[[row]])
        np.testing.assert_allclose(found.poses.positions[row], alone.poses.positions[0], atol=1e-9)
        np.testing.assert_allclose(found.poses.rotations[row], alone.poses.rotations[0], atol=1e-12)
