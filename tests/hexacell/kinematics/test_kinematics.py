"""Inverse, forward, derivatives and singularities against kinematics written for the tests alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.errors import ExitCode, ReachError
from hexacell.kinematics.forward import apply_twist, assembly_mode, continue_solution, forward_kinematics
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.inverse import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, hexaglide_geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import (
    has_singularity_margin,
    pose_jacobian,
    pose_sensitivity,
    position_sensitivity,
    singularity_margin,
)

degrees = st.floats(-25.0, 25.0)
poses = st.builds(
    Pose, st.floats(-100, 100), st.floats(-200, 100), st.floats(450, 600), degrees, degrees, degrees
)
small = st.floats(-1.0, 1.0)
nudges = st.tuples(small, small, small, small, small, small)
geometry_errors = st.lists(st.floats(-7.0, 7.0), min_size=35, max_size=35)
MARGIN = 0.05


def turned_about(axis: str, degrees: float) -> Pose:
    return Pose(0.0, 0.0, 550.0, **{axis: degrees})


def as_vector(poses: PoseBatch, row: int = 0) -> np.ndarray:
    return np.concatenate([poses.positions[row], Rotation.from_matrix(poses.rotations[row]).as_rotvec()])


def from_vector(vector: np.ndarray) -> PoseBatch:
    return PoseBatch(vector[None, :3], Rotation.from_rotvec(vector[None, 3:]).as_matrix())


def nudged(pose: Pose, by) -> PoseBatch:
    """Beside a pose by up to 10 mm and 0.1 rad on each axis."""
    turn = Rotation.from_rotvec(0.1 * np.array(by[3:])).as_matrix()
    return PoseBatch((pose.position + 10.0 * np.array(by[:3]))[None], (turn @ pose.rotation)[None])


@pytest.fixture
def inverse(hexaglide, paper):
    return lambda geometry, at: inverse_kinematics(hexaglide, geometry, paper.branch, at)


# --- inverse ---


def test_inverse_agrees_with_linuxcnc(inverse, paper):
    """LinuxCNC 2.9 running a hexaglide kinematics module of its own, docs/linuxcnc.md."""
    joints = inverse(paper.nominal, PoseBatch.of([Pose(10, 20, 560, 5, -4, 3)]))
    told = [-461.827519, -455.741652, -448.908104, 465.952312, 465.044723, 488.923462]
    np.testing.assert_allclose(joints, [told], atol=6e-7)


def test_a_pose_out_of_reach_names_the_leg_and_the_pose(inverse, paper):
    lengths = paper.nominal["l"].copy()
    lengths[3] = 400.0
    short_leg_4 = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], lengths)
    poses = PoseBatch.of([Pose(0, 0, 500), Pose(0, 0, 550), Pose(0, 0, 560, 1)])
    with pytest.raises(
        ReachError, match=r"^leg 4 cannot reach the pose X0\.000 Y0\.000 Z550\.000 "
    ) as caught:
        inverse(short_leg_4, poses)
    assert caught.value.exit_code is ExitCode.USAGE


# --- forward ---


@given(poses, nudges)
def test_forward_undoes_inverse(hexaglide, paper, legs, vector_of, pose, by):
    joints = legs(paper.actual).joints(vector_of(pose))
    assume(not np.isnan(joints).any())
    assume(legs(paper.actual).margin(joints, vector_of(pose)) > MARGIN)
    found = forward_kinematics(hexaglide, paper.actual, joints[None], nudged(pose, by))
    assert found.found[0]
    np.testing.assert_allclose(found.poses.positions[0], pose.position, atol=1e-8)
    np.testing.assert_allclose(found.poses.rotations[0], pose.rotation, atol=1e-10)


@given(poses, geometry_errors)
def test_inverse_undoes_following_to_another_geometry_and_back(hexaglide, paper, pose, errors):
    built = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + hexaglide.convention.basis() @ errors)
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
    assume(singularity_margin(hexaglide, built, there.poses, joints)[0] > MARGIN)
    assume(singularity_margin(hexaglide, paper.nominal, at, joints)[0] > MARGIN)
    back = continue_solution(
        hexaglide, paper.nominal, joints, start=there.poses, start_geometry=built, start_joints=joints
    )
    assert back.found[0]
    np.testing.assert_allclose(back.poses.positions, at.positions, atol=1e-7)
    np.testing.assert_allclose(back.poses.rotations, at.rotations, atol=1e-9)


@pytest.mark.parametrize("seed", [0, 2])
def test_following_ends_where_a_machine_bent_in_small_steps_ends(hexaglide, paper, visit, seed):
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


def test_following_changes_joints_and_geometry_together(hexaglide, paper, inverse):
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


def test_no_poses_are_no_poses(hexaglide, paper):
    nothing, none = PoseBatch.of([]), np.empty((0, 6))
    found = continue_solution(
        hexaglide, paper.actual, none, start=nothing, start_geometry=paper.nominal, start_joints=none
    )
    assert len(found.poses) == 0
    assert found.found.shape == (0,)
    assert len(forward_kinematics(hexaglide, paper.actual, none, nothing).poses) == 0
    assert singularity_margin(hexaglide, paper.actual, nothing, none).shape == (0,)


def test_sliders_pulled_apart_are_reported_and_spoil_no_other_pose(hexaglide, paper, inverse):
    at = PoseBatch.of([Pose(0, 0, 550, 5), Pose(10, 20, 560), Pose(0, 0, 540)])
    joints = inverse(paper.nominal, at)
    joints[1] += [-300, -300, -300, 300, 300, 300]
    for found in (
        forward_kinematics(hexaglide, paper.nominal, joints, nudged(Pose(0, 0, 550), [0.1] * 6)[[0, 0, 0]]),
        continue_solution(
            hexaglide,
            paper.nominal,
            joints,
            start=at,
            start_geometry=paper.nominal,
            start_joints=inverse(paper.nominal, at),
        ),
    ):
        np.testing.assert_array_equal(found.found, [True, False, True])
        np.testing.assert_allclose(found.poses.positions[[0, 2]], at.positions[[0, 2]], atol=1e-8)


@pytest.mark.parametrize("axis", ["a", "b", "c"])
def test_the_other_side_of_a_singularity_is_never_called_found(hexaglide, paper, inverse, axis):
    """Joint variables of poses beyond: either a pose on this side has them too, or none is found."""
    here = PoseBatch.of([turned_about(axis, 25.0)])
    beyond = PoseBatch.of([turned_about(axis, angle) for angle in np.arange(25.0, 66.0, 0.5)])
    joints = hexaglide.inverse(paper.nominal, paper.branch, beyond)
    joints = joints[~np.isnan(joints).any(axis=1)]
    starts = here[[0] * len(joints)]
    side = np.sign(
        np.linalg.det(numeric_jacobian(hexaglide, paper.nominal, here, inverse(paper.nominal, here)))
    )
    for found in (
        forward_kinematics(hexaglide, paper.nominal, joints, starts),
        continue_solution(
            hexaglide,
            paper.nominal,
            joints,
            start=starts,
            start_geometry=paper.nominal,
            start_joints=inverse(paper.nominal, starts),
        ),
    ):
        rows = np.flatnonzero(found.found)
        assert len(rows) >= 10
        for row in rows.tolist():
            end, at = found.poses[[row]], joints[[row]]
            np.testing.assert_allclose(hexaglide.constraints(paper.nominal, end, at), 0.0, atol=1e-8)
            assert np.sign(np.linalg.det(numeric_jacobian(hexaglide, paper.nominal, end, at))) == side


# --- derivatives ---


def numeric_jacobian(hexaglide, geometry, pose, joints):
    """Central differences of the constraints by position and by rotation vector from the left."""
    columns = []
    for step in 1e-5 * np.eye(6):
        ends = []
        for side in (1.0, -1.0):
            turn = Rotation.from_rotvec(side * step[3:]).as_matrix()
            moved = PoseBatch(pose.positions + side * step[:3], turn @ pose.rotations)
            ends.append(hexaglide.constraints(geometry, moved, joints)[0])
        columns.append((ends[0] - ends[1]) / 2e-5)
    return np.array(columns).T


def pose_difference(legs, joints, steps, near):
    """Of a machine's pose between two geometries or joint vectors, by the test's root finder."""
    plus, minus = (legs(geometry).closed(q, near) for geometry, q in steps)
    turn = Rotation.from_rotvec(plus[3:]) * Rotation.from_rotvec(minus[3:]).inv()
    return np.concatenate([plus[:3] - minus[:3], turn.as_rotvec()])


@pytest.mark.parametrize("pose", [Pose(10, 20, 560, 5, -4, 3), Pose(-60, -120, 480, 20, 15, -25)])
def test_sensitivity_is_how_the_pose_really_moves(hexaglide, paper, legs, vector_of, pose):
    geometry, near, step = paper.actual, vector_of(pose), 1e-3
    joints = legs(geometry).joints(near)
    found = pose_sensitivity(hexaglide, geometry, PoseBatch.of([pose]), joints[None])
    for n in range(6):
        shift = step * np.eye(6)[n]
        ends = [(geometry, joints + shift), (geometry, joints - shift)]
        moved = pose_difference(legs, joints, ends, near) / (2 * step)
        np.testing.assert_allclose(found.joints[0, :, n], moved, atol=1e-5)
    for n in range(42):
        shift = step * np.eye(42)[n]
        ends = [(Geometry(HEXAGLIDE_PARAMETERS, geometry.vector + s), joints) for s in (shift, -shift)]
        moved = pose_difference(legs, joints, ends, near) / (2 * step)
        np.testing.assert_allclose(found.parameters[0, :, n], moved, atol=1e-5)
    by_parameters, by_joints = position_sensitivity(hexaglide, geometry, PoseBatch.of([pose]), joints[None])
    np.testing.assert_allclose(by_parameters, found.parameters[:, :3], atol=1e-12)
    np.testing.assert_allclose(by_joints, found.joints[:, :3], atol=1e-12)


@given(poses)
def test_pose_jacobian_is_the_derivative_of_the_constraints(hexaglide, paper, pose):
    at = PoseBatch.of([pose])
    joints = hexaglide.inverse(paper.nominal, paper.branch, at)
    assume(not np.isnan(joints).any())
    found = pose_jacobian(hexaglide, paper.nominal, at, joints)[0]
    np.testing.assert_allclose(found, numeric_jacobian(hexaglide, paper.nominal, at, joints), atol=1e-5)


# --- singularities ---


@given(poses)
def test_margin_is_the_smallest_singular_value_with_turns_in_mean_radii(
    hexaglide, paper, legs, vector_of, pose
):
    joints = legs(paper.actual).joints(vector_of(pose))
    assume(not np.isnan(joints).any())
    margin = singularity_margin(hexaglide, paper.actual, PoseBatch.of([pose]), joints[None])
    assert margin[0] == pytest.approx(legs(paper.actual).margin(joints, vector_of(pose)), abs=1e-5)


@pytest.mark.parametrize(("axis", "clear", "beyond"), [("a", 30, 50), ("c", 40, 85), ("b", -30, -60)])
def test_margin_is_zero_where_the_jacobian_changes_its_sign(hexaglide, paper, axis, clear, beyond):
    def determinant(angle: float) -> float:
        at = PoseBatch.of([turned_about(axis, angle)])
        joints = hexaglide.inverse(paper.nominal, paper.branch, at)
        return float(np.linalg.det(numeric_jacobian(hexaglide, paper.nominal, at, joints)))

    low, high = float(clear), float(beyond)
    assert determinant(low) * determinant(high) < 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if determinant(middle) * determinant(low) > 0.0 else (low, middle)
    at = PoseBatch.of([turned_about(axis, angle) for angle in (clear, low, beyond)])
    joints = hexaglide.inverse(paper.nominal, paper.branch, at)
    margins = singularity_margin(hexaglide, paper.nominal, at, joints)
    assert margins[1] < 1e-7
    assert margins[0] > 0.03


def test_two_equal_legs_hold_the_platform_at_five_only(hexaglide, paper, inverse):
    S, B, l = paper.nominal["S"].copy(), paper.nominal["B"].copy(), paper.nominal["l"].copy()  # noqa: E741
    S[4], B[4], l[4] = S[3], B[3], l[3]
    twin = hexaglide_geometry(S, B, l)
    at = PoseBatch.of([Pose(0, 0, 550), Pose(20, 30, 500, 10, -5, 8)])
    margins = singularity_margin(hexaglide, twin, at, inverse(twin, at))
    np.testing.assert_allclose(margins, 0.0, atol=1e-12)


def test_margin_does_not_depend_on_the_size_of_the_machine(hexaglide, paper, inverse):
    at = PoseBatch.of([Pose(20, 30, 500, 10, -5, 8)])
    larger = Geometry(HEXAGLIDE_PARAMETERS, 3.0 * paper.actual.vector)
    at_larger = PoseBatch(3.0 * at.positions, at.rotations)
    np.testing.assert_allclose(
        singularity_margin(hexaglide, larger, at_larger, inverse(larger, at_larger)),
        singularity_margin(hexaglide, paper.actual, at, inverse(paper.actual, at)),
        rtol=1e-12,
    )


# --- many robots, many poses ---


def test_many_robots_at_once_stand_where_each_would(hexaglide, paper, inverse):
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


def test_a_pose_that_cannot_be_found_does_not_spoil_the_others(hexaglide, paper, inverse):
    at = PoseBatch.of([Pose(0, 0, 550), Pose(10, 0, 550), Pose(0, 10, 550)])
    joints = inverse(paper.nominal, at)
    joints[1] = np.nan
    displaced = apply_twist(at, np.full((3, 6), 0.01))
    mode = assembly_mode(pose_jacobian(hexaglide, paper.nominal, at, joints[[0, 0, 2]]))
    found = forward_kinematics(hexaglide, paper.nominal, joints, displaced, mode=mode)
    assert found.found.tolist() == [True, False, True]
    np.testing.assert_allclose(found.poses.positions[[0, 2]], at.positions[[0, 2]], atol=1e-8)


@given(st.lists(poses, min_size=1, max_size=6), st.floats(0.0, 0.4))
def test_the_margin_is_kept_where_it_is_as_large(hexaglide, paper, at, margin):
    stands = PoseBatch.of(at)
    joints = hexaglide.inverse(paper.nominal, paper.branch, stands)
    assume(np.isfinite(joints).all())
    exactly = singularity_margin(hexaglide, paper.nominal, stands, joints)
    assume(np.abs(exactly - margin).min() > 1e-9)
    kept = has_singularity_margin(hexaglide, paper.nominal, stands, joints, margin)
    np.testing.assert_array_equal(kept, exactly >= margin)
