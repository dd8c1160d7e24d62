"""The scale of the encoders as it is told: its sign, its remedy, and that it was not checked."""

import pytest

from hexacell.results.result import LengthResult
from hexacell.text.verdict import earlier_scale_line, not_checked, scale_lines


def length_of(long_um_m: float = 12.0, reason: str = "") -> LengthResult:
    return LengthResult(
        distance_mm=300.0,
        length_mm=300.0036,
        long_um_m=long_um_m,
        expanded_um_m=20.0,
        stated_um_m=15.0,
        sources=(),
        is_consistent=not reason,
        reason=reason,
    )


@pytest.mark.parametrize(
    ("sign", "direction", "factor"), [(1, "long", "0.999001"), (-1, "short", "1.001001")]
)
def test_a_scale_is_one_line_and_a_significant_one_has_its_remedy(sign, direction, factor) -> None:
    said = f"encoders read 12 +- 20 um/m {direction}"
    assert scale_lines(length_of(sign * 12.0)) == [f"length scale: checked over 300.000 mm: {said}"]
    assert earlier_scale_line(length_of(sign * 12.0)).endswith(f"as checked in that run: {said}")
    remedy = " ".join(" ".join(scale_lines(length_of(sign * 1000.0))).split())
    assert f"multiply the scale factor of all encoders by {factor}, at the drives" in remedy


def test_what_was_not_checked_is_said_and_what_says_nothing_is_left_out() -> None:
    assert scale_lines(None) == [not_checked()] == [earlier_scale_line(None)]
    assert scale_lines(length_of(reason="the fixture moved")) == []
    assert earlier_scale_line(length_of(reason="the fixture moved")) == not_checked()
