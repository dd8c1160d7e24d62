"""What a run says of the noise that it measured: figures, what is wrong, and what to do."""

from typing import Any

import pytest

from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource
from hexacell.noise.measured_noise import AveragingForecast, InstrumentNoise, MeasuredNoise
from hexacell.text.measured_noise import measured_noise_text


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
