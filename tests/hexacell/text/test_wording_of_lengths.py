"""The length scale and measured noise in words."""

from typing import Any

import pytest

from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource
from hexacell.noise.measured_noise import AveragingForecast, InstrumentNoise, MeasuredNoise
from hexacell.results.result import LengthResult, LengthSource
from hexacell.text.measured_noise import measured_noise_text
from hexacell.text.verdict import earlier_scale_line, length_text, not_checked, scale_lines
from hexacell.verdict.decision import JudgedError, Verdict
from hexacell.verdict.length_check import LengthStatement
from hexacell.verdict.verification import length_line

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


def instrument(name: str, **more: Any) -> InstrumentNoise:
    usual = {"reading": 0.001, "degrees_of_freedom": 38, "stated": 0.01, "record": 0.01}
    return InstrumentNoise(name=name, **(usual | more))


def measured(*changed: InstrumentNoise, **more: Any) -> MeasuredNoise:
    names = [*(f"gauge {axis}" for axis in "xyz"), *(f"encoder {leg}" for leg in range(1, 7))]
    every = {name: instrument(name) for name in names} | {one.name: one for one in changed}
    x, y, z, *encoders = every.values()
    return MeasuredNoise(gauges=(x, y, z), encoders=tuple(encoders), **more)


def said(noise: MeasuredNoise) -> str:
    return " ".join(measured_noise_text(noise, with_averaging=True).split())


def visits(ratio: float, source: ScatterSource | None = None, excess: float = 0.0) -> RepeatedApproaches:
    return RepeatedApproaches(
        visits=7,
        degrees_of_freedom=18,
        ball_mm=0.02,
        ratio=ratio,
        ratio_as_drawn=ratio,
        source=source,
        excess=excess,
    )


def test_the_ranges_of_unlike_instruments_are_told() -> None:
    text = said(measured(instrument("gauge y", reading=0.004, record=0.02)))
    assert "gauges 10 to 20, encoders 10 um a record" in text
    assert "readings at rest: gauges 1 to 4, enc" in text
    quiet = said(measured(approaches=visits(0.9)))
    assert "7 visits of one pose agree with what is stated for a record: they scatter 0.9 times" in quiet
    assert "at rest" not in said(measured(instrument("gauge x", reading=None)))


@pytest.mark.parametrize(
    ("name", "action"), [("gauge y", "a loose clamp"), ("encoder 3", "its cable, its head and vibration")]
)
def test_a_noisy_instrument_is_named_with_what_to_do(name: str, action: str) -> None:
    noisy = instrument(name, reading=0.113, record=0.045, is_noisier=True)
    text = said(measured(noisy))
    assert f"{name}: its readings scatter by 113 um without moving, more than the 10 um stated" in text
    assert "The run counts with 45 um." in text
    assert action in text
    assert "state it in [noise]" in text
    assert "scatter by" not in said(measured(instrument(name, reading=0.113)))


def test_drift_and_false_readings_are_told_where_they_matter() -> None:
    for name, changed, told in (
        ("gauge z", {"drift": -0.03}, "it drifted by -30 um within the series: let it warm up"),
        ("encoder 2", {"drift": 0.03}, "it drifted by +30 um within the series: see whether it slides"),
        ("gauge x", {"outliers": 1}, "a reading was false, and left out."),
        ("gauge x", {"outliers": 2}, "2 readings were false"),
    ):
        assert f"{name}: {told}" in said(measured(instrument(name, **changed)))
    assert "drifted" not in said(measured(instrument("gauge z", drift=-0.002)))


def test_what_does_not_repeat_is_named_with_what_to_do() -> None:
    for source, what, action in (
        (ScatterSource.JOINTS, "the joints stop 49 um beside what their encoders show", "Look for play"),
        (ScatterSource.ENCODER_3, "encoder 3: 49 um beside where the joints are", "reading heads"),
        (ScatterSource.GAUGE_Z, "gauge z shows 49 um more or less at the same place", "its plunger"),
    ):
        text = said(measured(approaches=visits(4.2, source, 0.049)))
        assert "7 visits of one pose scatter 4.2 times as much as the stated noise explains" in text
        assert what in text
        assert action in text
        assert "agree with what is stated" not in text


def forecasts(*errors: float) -> tuple[AveragingForecast, ...]:
    return tuple(
        AveragingForecast(windows=2**place, error_mm=error, minutes=0.5 * (2**place - 1))
        for place, error in enumerate(errors)
    )


def test_means_of_more_readings_are_told_with_their_gain() -> None:
    text = said(measured(forecasts=forecasts(0.2, 0.15, 0.12, 0.115), encoders_part_mm=0.17))
    assert "the encoders contribute 0.170 of the 0.200 mm expected at the task in the end" in text
    assert "4 windows of readings a record would give 0.120 mm for 2 minutes more" in text
    assert "averaged_windows = 4 in [noise] allows it" in text
    text = said(measured(forecasts=forecasts(0.2, 0.15, 0.12), windows=4))
    assert "a record is the mean of 4 windows of readings, which gives 0.120 mm for 2 minutes more" in text
    assert "allows it" not in text
    text = said(measured(forecasts=forecasts(0.2, 0.199, 0.198), encoders_part_mm=0.17))
    assert "windows" not in text
