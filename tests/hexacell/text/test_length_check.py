"""The length scale as a person reads of it, and where the gauges are wanted in a length check."""

import pytest

from hexacell.results.result import LengthResult, LengthSource
from hexacell.text.verdict import earlier_scale_line, length_text, not_checked, scale_lines
from hexacell.verdict.decision import JudgedError, Verdict
from hexacell.verdict.length_check import LengthStatement
from hexacell.verdict.outcome import length_line

SIZES = {
    "noise of the readings": 8.0,
    "certificate": 3.4,
    "seating of the gauges": 4.1,
    "waves": 0.1,
    "sag": 1,
}
SOURCES = tuple(LengthSource(name=name, um_m=size) for name, size in SIZES.items())
ERROR = JudgedError(value=0.19, expanded=0.004, limit=0.15, verdict=Verdict.FAIL)


def length_of(long_um_m: float = 12.0, reason: str = "") -> LengthResult:
    return LengthResult(
        distance_mm=300.0,
        length_mm=300.0036,
        long_um_m=long_um_m,
        expanded_um_m=20.0,
        stated_um_m=15.0,
        sources=SOURCES,
        is_consistent=not reason,
        reason=reason,
    )


def stated(found: LengthResult, verdict: Verdict = Verdict.PASS) -> LengthStatement:
    return LengthStatement(verdict=verdict, result=found, error=ERROR)


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


def test_a_length_check_of_its_own_says_what_the_scale_does_and_its_largest_sources() -> None:
    lines = length_text(stated(length_of(1000.0), Verdict.FAIL)).splitlines()
    assert lines[0] == "verdict: fail"
    assert "  position error by that at the task poses: 0.190 mm, U 0.004 (limit 0.15)" in lines
    assert " ".join(" ".join(lines).split()).endswith(
        "1 sigma: noise of the readings 8.0, seating of the gauges 4.1, certificate 3.4, sag 1.0"
    )
    assert length_line(stated(length_of(1000.0), Verdict.FAIL)) == (
        "length check over 300.000 mm: encoders read 1000 +- 20 um/m long; position error by that "
        "0.190 +- 0.004 mm (limit 0.15): fail"
    )


def test_a_check_that_contradicts_itself_says_why() -> None:
    found = stated(length_of(1000.0, "the gauges were zeroed"), Verdict.NOT_EVALUATED)
    assert "  the length check says nothing: the gauges were zeroed" in length_text(found)
    assert length_line(found) == "length check: not evaluated (the gauges were zeroed)"
