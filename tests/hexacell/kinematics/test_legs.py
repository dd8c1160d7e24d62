"""Distances of legs, derivatives and singularity margins are those of independent computations."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from hexacell.cell.loader import load_cell
from hexacell.identification.placement import Placement
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import segment_distances
from hexacell.kinematics.mechanism import inverse_kinematics, joint_zeros
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import (
    POSITION,
    free_sensitivity,
    has_singularity_margin,
    singularity_margin,
)
from hexacell.robot.model import robot_of
from tests.hexacell.conftest import vector
from tests.hexacell.kinematics.numeric import POSES

points = arrays(float, (4, 3), elements=st.floats(-100, 100, width=32))


def nearest(ends):
    """By a bounded search from all corners."""
    start, end, other_start, other_end = ends

    def square(shares):
        one = start + shares[0] * (end - start)
        other = other_start + shares[1] * (other_end - other_start)
        return float(np.sum((one - other) ** 2))

    found = [
        minimize(square, corner, bounds=[(0, 1), (0, 1)]).fun
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1), (0.5, 0.5))
    ]
    return np.sqrt(min(found))


@given(points)
def test_the_distance_of_two_segments_is_that_of_their_nearest_points(ends):
    if min(np.linalg.norm(ends[1] - ends[0]), np.linalg.norm(ends[3] - ends[2])) < 1.0:
        return
    assert segment_distances(*ends) == pytest.approx(nearest(ends), abs=1e-2)


@pytest.mark.parametrize(
    ("ends", "distance"),
    [
        ([[0, 0, 0], [10, 0, 0], [0, 3, 0], [10, 3, 0]], 3.0),
        ([[0, 0, 0], [10, 0, 0], [20, 3, 0], [30, 3, 0]], np.hypot(10, 3)),
        ([[0, 0, 0], [10, 0, 0], [5, -5, 2], [5, 5, 2]], 2.0),
        ([[0, 0, 0], [10, 0, 0], [5, 4, 0], [5, 9, 0]], 4.0),
        ([[0, 0, 0], [10, 0, 0], [5, -1, 0], [5, 1, 0]], 0.0),
    ],
    ids=["parallel", "parallel, one behind the other", "crossing above", "an end", "through each other"],
)
def test_the_distance_of_segments_that_are_easily_seen(ends, distance):
    assert segment_distances(*np.array(ends, dtype=float)) == pytest.approx(distance)


CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.mark.parametrize("name", ["simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks"])
def test_moved_zeros_change_joint_variables_and_not_what_includes_them(name: str) -> None:
    cell = load_cell(CONFIGS / f"{name}.toml")
    robot = robot_of(cell)
    mechanism, geometry = robot.mechanism, robot.controller
    poses = PoseBatch.of([Pose(*pose) for pose in cell.settings.task.poses])
    moved = np.array([1.0, -2.0, 0.5, 3.0, -0.1, 0.0])
    other = Geometry(geometry.parameters, geometry.vector + mechanism.encoder_zeros(geometry) @ moved)
    joints, of_other = (
        inverse_kinematics(mechanism, one, robot.branch, poses) for one in (geometry, other)
    )
    np.testing.assert_allclose(joints - of_other, np.broadcast_to(moved, joints.shape), atol=1e-9)
    np.testing.assert_allclose(
        joints + joint_zeros(mechanism, geometry), of_other + joint_zeros(mechanism, other), atol=1e-9
    )


def pose_difference(legs, joints, steps, near):
    """Of a machine's pose between two geometries or joint vectors, by the test's root finder."""
    plus, minus = (legs(geometry).closed(q, near) for geometry, q in steps)
    turn = Rotation.from_rotvec(plus[3:]) * Rotation.from_rotvec(minus[3:]).inv()
    return np.concatenate([plus[:3] - minus[:3], turn.as_rotvec()])


@pytest.mark.parametrize("pose", [Pose(10, 20, 560, 5, -4, 3), Pose(-60, -120, 480, 20, 15, -25)])
def test_sensitivity_agrees_with_finite_differences(hexaglide, paper, legs, pose):
    geometry, near, step = paper.actual, vector(pose), 1e-3
    joints = legs(geometry).joints(near)
    at = hexaglide, geometry, PoseBatch.of([pose]), joints[None]
    found, by_parameters = free_sensitivity(*at), Placement(*at).by_parameters(np.eye(42))
    for n in range(6):
        shift = step * np.eye(6)[n]
        ends = [(geometry, joints + shift), (geometry, joints - shift)]
        moved = pose_difference(legs, joints, ends, near) / (2 * step)
        np.testing.assert_allclose(found.joints[0, :, n], moved, atol=1e-5)
    for n in range(42):
        shift = step * np.eye(42)[n]
        ends = [(Geometry(HEXAGLIDE_PARAMETERS, geometry.vector + s), joints) for s in (shift, -shift)]
        moved = pose_difference(legs, joints, ends, near) / (2 * step)
        np.testing.assert_allclose(by_parameters[0, :, n], moved, atol=1e-5)
    np.testing.assert_allclose(found.free, by_parameters @ hexaglide.convention.basis, atol=1e-12)
    short = free_sensitivity(*at, POSITION)
    np.testing.assert_allclose(short.free, found.free[:, :3], atol=1e-12)
    np.testing.assert_allclose(short.joints, found.joints[:, :3], atol=1e-12)


@given(POSES)
def test_margin_is_the_smallest_singular_value_of_the_scaled_jacobian(hexaglide, paper, legs, pose):
    joints = legs(paper.actual).joints(vector(pose))
    assume(not np.isnan(joints).any())
    margin = singularity_margin(hexaglide, paper.actual, PoseBatch.of([pose]), joints[None])
    assert margin[0] == pytest.approx(legs(paper.actual).margin(joints, vector(pose)), abs=1e-5)


def test_margin_does_not_depend_on_the_size_of_the_machine(hexaglide, paper, inverse):
    at = PoseBatch.of([Pose(20, 30, 500, 10, -5, 8)])
    larger = Geometry(HEXAGLIDE_PARAMETERS, 3.0 * paper.actual.vector)
    at_larger = PoseBatch(3.0 * at.positions, at.rotations)
    np.testing.assert_allclose(
        singularity_margin(hexaglide, larger, at_larger, inverse(larger, at_larger)),
        singularity_margin(hexaglide, paper.actual, at, inverse(paper.actual, at)),
        rtol=1e-12,
    )


@given(st.lists(POSES, min_size=1, max_size=6), st.floats(0.0, 0.4))
def test_has_margin_agrees_with_the_margin(hexaglide, paper, at, margin):
    batch = PoseBatch.of(at)
    joints = hexaglide.inverse(paper.nominal, paper.branch, batch)
    assume(np.isfinite(joints).all())
    margins = singularity_margin(hexaglide, paper.nominal, batch, joints)
    assume(np.abs(margins - margin).min() > 1e-9)
    kept = has_singularity_margin(hexaglide, paper.nominal, batch, joints, margin)
    np.testing.assert_array_equal(kept, margins >= margin)
