"""Rotations against scipy's, the controllers' angles, and axes that turns put somewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import SERIES, TurnedAxes, turns_of

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


turn = st.floats(-2.0, 2.0)
small = st.floats(-2.0 * SERIES, 2.0 * SERIES)


@given(turn | small, turn | small)
def test_axes_are_those_of_the_rotation_vector_and_derivatives_those_of_the_axes(a, b) -> None:
    found = TurnedAxes.by(np.array([a, b]))
    turned = Rotation.from_rotvec([a, b, 0.0]).as_matrix()
    np.testing.assert_allclose(np.stack([found.u, found.w, found.axis], axis=-1), turned, atol=1e-12)
    for column, step in enumerate(1e-5 * np.eye(2)):
        after, before = (TurnedAxes.by(np.array([a, b]) + side * step) for side in (1.0, -1.0))
        np.testing.assert_allclose(found.by_turns[0][:, column], (after.u - before.u) / 2e-5, atol=1e-9)
        np.testing.assert_allclose(found.by_turns[1][:, column], (after.w - before.w) / 2e-5, atol=1e-9)


@pytest.mark.parametrize("size", [0.999 * SERIES, 1.001 * SERIES])
def test_the_series_meets_the_quotient(size: float) -> None:
    """To what rounding leaves of the quotient there."""
    found, beyond = (TurnedAxes.by(np.array([one, 0.5 * one])) for one in (size, 1.0001 * size))
    np.testing.assert_allclose(found.by_turns[0], beyond.by_turns[0], atol=2.0 * size * 1e-4)


@given(turn, turn)
def test_turns_are_found_from_axes(a: float, b: float) -> None:
    np.testing.assert_allclose(turns_of(TurnedAxes.by(np.array([a, b])).axis), [a, b], atol=1e-9)


def test_the_opposite_of_z_is_half_a_turn() -> None:
    assert np.linalg.norm(turns_of(np.array([0.0, 0.0, -1.0]))) == pytest.approx(np.pi)
