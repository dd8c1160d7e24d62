"""What must be taught anew, in words: an order if it must, and no alarm if it need not."""

from __future__ import annotations

import pytest

from hexacell.results.written_geometry import TaskDisplacement
from hexacell.text.verdict import teaching_line, teaching_sentence


@pytest.mark.parametrize(
    ("mm", "deg", "figures"),
    [
        (30.775, 4.227, "30.8 mm, 4.23 deg"),
        (0.0449, 12.0, "0.045 mm, 12.0 deg"),
        (1.0, 1e-9, "1.00 mm, 0.001 deg"),
    ],
)
def test_how_far_taught_points_move_is_in_the_sentence(mm, deg, figures):
    moved = TaskDisplacement(position_mm=mm, orientation_deg=deg, poses=6, is_within_limits=False)
    assert teaching_sentence(moved) == (
        f"Teach anew: Cartesian points, work and tool frames move by up to {figures} at the task poses. "
        "Points taught by joints stay."
    )
    assert teaching_line(moved) == (f"Teach Cartesian points and frames anew: they move by up to {figures}")
    within = teaching_sentence(moved.model_copy(update={"is_within_limits": True}))
    assert within == (
        "Nothing need be taught anew: taught points and frames move by at most "
        f"{figures} at the task poses."
    )


def test_the_line_fits_a_terminal_however_far_they_move():
    moved = TaskDisplacement(position_mm=1234.5, orientation_deg=179.9, poses=6, is_within_limits=False)
    assert len(teaching_line(moved)) <= 80
    within = moved.model_copy(update={"is_within_limits": True})
    assert (
        teaching_line(within) == "Taught points and frames stay: they move by at most 1234.5 mm, 179.9 deg"
    )
