"""Rotations against scipy's, and the angle convention of the controllers by example."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics import rotations

angle = st.floats(-np.pi, np.pi)
angles = st.tuples(angle, angle, angle)
tiny_or_large = st.one_of(st.floats(-1e-9, 1e-9), st.floats(-10.0, 10.0))


@pytest.mark.parametrize(
    ("abc_deg", "turned", "into"),
    [
        ((90, 0, 0), [0, 1, 0], [0, 0, 1]),
        ((0, 90, 0), [0, 0, 1], [1, 0, 0]),
        ((0, 0, 90), [1, 0, 0], [0, 1, 0]),
        ((90, 90, 0), [0, 1, 0], [1, 0, 0]),  # a first: y to z; then b: z to x
        ((90, 0, 90), [0, 0, 1], [1, 0, 0]),  # a first: z to -y; then c: -y to x
    ],
)
def test_angles_turn_about_fixed_axes_x_then_y_then_z(abc_deg, turned, into):
    np.testing.assert_allclose(rotations.from_angles(np.radians(abc_deg)) @ turned, into, atol=1e-15)


@given(angles)
def test_from_angles_is_scipys_extrinsic_xyz(abc):
    expected = Rotation.from_euler("xyz", abc).as_matrix()
    np.testing.assert_allclose(rotations.from_angles(abc), expected, atol=1e-14)


@given(angle, st.floats(-1.5, 1.5), angle)
def test_to_angles_gives_the_angles_back(a, b, c):
    back = rotations.to_angles(rotations.from_angles([a, b, c]))
    difference = np.angle(np.exp(1j * (back - [a, b, c])))  # -pi and pi are the same angle
    np.testing.assert_allclose(difference, 0.0, atol=1e-12)


@given(angle, st.sampled_from([-1.0, 1.0]), st.floats(-14.0, 0.0), angle)
def test_to_angles_describes_the_same_rotation_however_near_to_gimbal_lock(a, side, exponent, c):
    exact = rotations.from_angles([a, side * (np.pi / 2 - 10.0**exponent), c])
    away_and_back = rotations.from_vector([0.1, 0.2, 0.3]), rotations.from_vector([-0.1, -0.2, -0.3])
    rounded = away_and_back[0] @ (away_and_back[1] @ exact)
    np.testing.assert_allclose(rotations.from_angles(rotations.to_angles(rounded)), exact, atol=1e-11)


@pytest.mark.parametrize("side", [-1, 1])
def test_gimbal_lock_puts_all_of_the_turn_into_a(side):
    rotation = rotations.from_angles([0.3, side * np.pi / 2, 0.2])
    np.testing.assert_allclose(
        rotations.to_angles(rotation), [0.3 - side * 0.2, side * np.pi / 2, 0.0], atol=1e-12
    )


@given(st.lists(st.tuples(tiny_or_large, tiny_or_large, tiny_or_large), min_size=1, max_size=5))
def test_from_vector_is_scipys(vectors):
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(rotations.from_vector(vectors), expected, atol=1e-13)


@given(angles, st.one_of(st.floats(0.0, 1e-9), st.floats(0.0, np.pi - 1e-6)))
def test_to_vector_gives_the_vector_back(direction, size):
    length = np.linalg.norm(direction)
    vector = size * np.asarray(direction) / length if length > 1e-3 else np.array([0.0, 0.0, size])
    np.testing.assert_allclose(rotations.to_vector(rotations.from_vector(vector)), vector, atol=1e-9)


@given(angles, angles)
def test_skew_is_the_cross_product(u, v):
    np.testing.assert_allclose(rotations.skew(u) @ v, np.cross(u, v), atol=1e-14)


@pytest.mark.parametrize("lead", [(), (0,), (3,), (2, 3)])
def test_any_batch_shape(lead):
    values = np.random.default_rng(0).uniform(-1.0, 1.0, (*lead, 3))
    for to_matrix, back in (
        (rotations.from_angles, rotations.to_angles),
        (rotations.from_vector, rotations.to_vector),
    ):
        matrices = to_matrix(values)
        assert matrices.shape == (*lead, 3, 3)
        np.testing.assert_allclose(back(matrices), values, atol=1e-14)
