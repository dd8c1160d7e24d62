"""Axes that turns about x and y put somewhere, with their derivatives, near zero and far from it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics.rotations import SERIES, TurnedAxes, turns_of

turn = st.floats(-2.0, 2.0)
small = st.floats(-2.0 * SERIES, 2.0 * SERIES)


@given(turn | small, turn | small)
def test_axes_are_those_of_the_rotation_vector(a: float, b: float) -> None:
    found = TurnedAxes.by(np.array([a, b]))
    turned = Rotation.from_rotvec([a, b, 0.0]).as_matrix()
    np.testing.assert_allclose(np.stack([found.u, found.w, found.axis], axis=-1), turned, atol=1e-12)


@given(turn | small, turn | small)
def test_derivatives_are_those_of_the_axes(a: float, b: float) -> None:
    found = TurnedAxes.by(np.array([a, b]))
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
