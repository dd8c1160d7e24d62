"""The straight line between two commands: checked over its whole length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.path_check import is_clear
from hexacell.motion.trajectory import PIECES, interpolate_line


def at(*numbers: float) -> PoseBatch:
    return PoseBatch.of([Pose(*numbers)])


@pytest.fixture(scope="module")
def exactly(know, paper, limits):
    """A robot as drawn, and known exactly."""

    def known(**change):
        return know(paper.nominal, limits=replace(limits, **change))

    return known


def test_all_six_numbers_are_interpolated_linearly():
    way = interpolate_line(at(0, 0, 500, -10, 0, 40), at(12, -24, 560, 14, 6, -8), pieces=4)
    numbers = [way.pose(row).as_tuple() for row in range(5)]
    np.testing.assert_allclose(numbers[0], (0, 0, 500, -10, 0, 40), atol=1e-9)
    np.testing.assert_allclose(numbers[1], (3, -6, 515, -4, 1.5, 28), atol=1e-9)
    np.testing.assert_allclose(numbers[4], (12, -24, 560, 14, 6, -8), atol=1e-9)


def test_angles_are_interpolated_as_numbers_even_over_the_longer_arc():
    way = interpolate_line(at(0, 0, 550, 0, 0, 170), at(0, 0, 550, 0, 0, -170), pieces=2)
    assert way.pose(1).c == pytest.approx(0.0, abs=1e-9)


def test_an_open_line_is_clear(exactly):
    assert is_clear(exactly(), at(0, 0, 550), at(50, -60, 540, 20, -15, 25))


def test_a_line_is_clear_in_both_directions_or_in_none(exactly):
    ends = [at(0, 0, 550, 10), at(30, 20, 560, -20, 5, 10), at(0, 0, 550, 44), at(20, 0, 899)]
    for start in ends:
        for end in ends:
            assert is_clear(exactly(), start, end) == is_clear(exactly(), end, start)


def test_a_line_through_a_singularity_is_refused_though_both_ends_are_clear(
    exactly, legs, paper, vector_of
):
    """The platform is singular at about 46 deg of A, and has margin again on the other side."""
    low, high = Pose(0, 0, 550, 30), Pose(0, 0, 550, 51)
    for pose in (low, high):
        vector = vector_of(pose)
        assert legs(paper.nominal).margin(legs(paper.nominal).joints(vector), vector) > 0.02
    limited = exactly(singularity_margin=0.02)
    assert not is_clear(limited, at(*low.as_tuple()), at(*high.as_tuple()))
    assert is_clear(limited, at(*low.as_tuple()), at(0, 0, 550, 41))


@pytest.mark.parametrize("start", np.arange(11.5, 17.5, 0.5))
def test_a_singularity_between_two_samples_is_detected(exactly, start):
    """With a small limit and long pieces the margin alone may step over it."""
    assert 3.0 * PIECES == 36.0
    assert not is_clear(
        exactly(singularity_margin=0.002), at(0, 0, 550, start), at(0, 0, 550, start + 36.0)
    )


def test_the_joint_range_is_checked_along_the_line(exactly):
    """Both ends are inside; in the middle, where the platform is highest, no slider is."""
    tight = exactly(joint_min_mm=-480.0, joint_max_mm=480.0)
    low, high = at(0, -50, 600), at(0, 60, 600)
    assert is_clear(exactly(), low, high)
    ends_only = exactly(joint_min_mm=-520.0, joint_max_mm=520.0)
    assert is_clear(ends_only, low, high)
    assert not is_clear(tight, at(0, 0, 600), at(0, 0, 480))


def test_a_line_out_of_reach_is_refused(exactly):
    assert not is_clear(exactly(), at(0, 0, 550), at(0, 0, 899))


def test_the_line_is_clear_for_the_estimated_robot_too(know, paper):
    """For the controller's geometry the line is clear; the actual robot comes next to a singularity."""
    start, end = at(0, 0, 550), at(0, 0, 550, 32)
    assert is_clear(know(paper.nominal), start, end)
    assert not is_clear(know(paper.actual), start, end)


def test_the_travel_is_checked_along_the_line(know, paper, exactly):
    """A robot with errors: a tilt of 10 deg takes the ball millimetres away from the reference."""
    real = know(paper.actual)
    start, end = at(0, 0, 550), at(0, 0, 550, 0, 0, 20)
    where = np.array([0.0, 0.0, 550.0])
    assert is_clear(exactly(), start, end, where)
    assert is_clear(real, start, end)
    assert not is_clear(real, start, end, where)


def test_the_travel_is_around_the_reference_given(exactly):
    start, end = at(0, 0, 550), at(4, 0, 550)
    assert is_clear(exactly(), start, end, np.array([0.0, 0.0, 550.0]))
    assert is_clear(exactly(), start, end, np.array([4.9, 0.0, 550.0]))
    assert not is_clear(exactly(), start, end, np.array([-1.5, 0.0, 550.0]))
    assert not is_clear(exactly(), start, end, np.array([0.0, 0.0, 555.5]))
