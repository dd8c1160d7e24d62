"""Motions of the simulated sliders along a path, from standstill to standstill."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.simulated.physics import RAMP_S, Motion

PATH = np.array([[0.0] * 6, [1.0] * 6, [3.0, 2.0, 2.0, 2.0, 2.0, 2.0]])


@pytest.fixture
def motion() -> Motion:
    return Motion(PATH, start_s=10.0, duration_s=4.0)


@pytest.mark.parametrize(
    ("now_s", "fraction"),
    [
        (0.0, 0.0),
        (10.0, 0.0),
        (12.0, 0.5),
        (14.0, 1.0),
        (99.0, 1.0),
        (10.1, 0.05 / (2.0 * 3.8)),
        (11.0, 0.9 / 3.8),
    ],
)
def test_fraction_of_the_path(motion: Motion, now_s: float, fraction: float) -> None:
    assert motion.fraction(now_s) == pytest.approx(fraction)
    assert motion.path_position(now_s) == pytest.approx(2.0 * fraction)


def test_a_motion_is_linear_between_rows_of_the_path(motion: Motion) -> None:
    place = motion.path_position(13.0)
    assert 1.0 < place < 2.0
    expected = PATH[1] + (place - 1.0) * (PATH[2] - PATH[1])
    assert motion.joints(13.0) == pytest.approx(expected)


@given(st.floats(0.0, 1.0), st.floats(0.5, 20.0))
def test_no_piece_is_passed_faster_than_at_the_rate_between_the_ramps(
    place: float, duration_s: float
) -> None:
    motion = Motion(PATH, start_s=0.0, duration_s=duration_s + RAMP_S)
    now_s = place * motion.duration_s
    passed = motion.fraction(now_s + 1e-3) - motion.fraction(now_s)
    assert passed <= 1e-3 / duration_s * (1.0 + 1e-9)


@given(stopped=st.floats(10.0, 14.0), later=st.floats(0.0, 100.0))
def test_a_stopped_motion_stays_at_its_position(stopped: float, later: float) -> None:
    motion = Motion(PATH, start_s=10.0, duration_s=4.0)
    halted = replace(motion, stopped_s=stopped)
    assert halted.end_s == stopped
    assert np.array_equal(halted.joints(stopped + later), motion.joints(stopped))
