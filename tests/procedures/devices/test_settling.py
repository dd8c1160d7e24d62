"""Settling: readings must agree for the time stated in the cell file."""

import asyncio
import math
from typing import Any, cast

import numpy as np
import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, GaugeUnsteady
from drivers.interfaces import EncoderSample, GaugeReading
from hexacell.cell.measuring import TimingSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, ExitCode, HexacellError, SeveralErrors
from procedures.devices.settling import LEAST_WINDOWS, read_all, read_series, settle, trimmed_mean

TIMING = TimingSettings.model_validate({"spread_encoder_mm": 0.05})


def unsteady(name: str) -> GaugeUnsteady:
    return GaugeUnsteady("readings do not agree", subject=f"gauge {name}")


def at_end(name: str) -> GaugeAtEnd:
    return GaugeAtEnd("is at an end of its travel", subject=f"gauge {name}")


def slowed(bench: Any, seconds: float, drift: float = 0.0) -> None:
    """Let the readings of a gauge take some time, and drift by so much in a second."""

    def shown() -> float:
        bench.clock.time_s += seconds
        return float(bench.clock.now()) * drift

    bench.gauges[0].shown = shown


@pytest.mark.parametrize("interval_s", [TIMING.interval_s, 5.0, 0.01])
async def test_a_robot_at_rest_is_settled_after_one_window(bench, interval_s: float) -> None:
    timing = TIMING.model_copy(update={"interval_s": interval_s})
    settled = await settle(bench.devices, timing, bench.clock)
    times = [look.at_s for look in settled.window]
    assert len(times) >= timing.readings
    assert times[-1] - times[0] >= timing.window_s
    assert bench.clock.now() < max(2 * timing.window_s, timing.readings * interval_s)


@pytest.mark.parametrize("reading_s", [0.0, 0.04, 0.1, 0.25])
async def test_readings_begin_an_interval_apart_or_as_soon_as_the_devices_are_ready(bench, reading_s):
    slowed(bench, reading_s)
    settled = await settle(bench.devices, TIMING, bench.clock)
    series = await read_series(bench.devices, TIMING, bench.clock, 12)
    for window in (settled.window, series.window):
        apart = np.diff([look.at_s for look in window])
        assert apart == pytest.approx(max(reading_s, TIMING.interval_s))


@pytest.mark.parametrize("axis", [0, 1, 2])
async def test_settling_waits_until_oscillation_decays(bench, axis: int) -> None:
    def ringing() -> float:
        t = bench.clock.now()
        return 1.5 + 0.5 * math.exp(-t / 0.5) * math.cos(2.0 * math.pi * 1.3 * t)

    bench.gauges[axis].shown = ringing
    settled = await settle(bench.devices, TIMING, bench.clock)
    # Its swing is within the limit from here on at the earliest: 2 * 0.5 * exp(-t / 0.5) = 0.06.
    assert settled.window[-1].at_s > 0.5 * math.log(1.0 / 0.06)
    assert np.ptp(settled.gauges[:, axis]) <= TIMING.spread_gauge_mm
    assert settled.gauges[:, axis].mean() == pytest.approx(1.5, abs=TIMING.spread_gauge_mm)


async def test_readings_before_a_jump_do_not_count_and_limits_are_included(bench) -> None:
    bench.gauges[0].shown = lambda: 0.0 if bench.clock.now() < 0.45 else 1.0
    settled = await settle(bench.devices, TIMING, bench.clock)
    assert set(settled.gauges[:, 0]) == {1.0}
    values = iter(np.tile([0.0, TIMING.spread_gauge_mm], 200).tolist())
    bench.gauges[0].shown = values.__next__
    settled = await settle(bench.devices, TIMING, bench.clock)
    assert np.ptp(settled.gauges[:, 0]) == TIMING.spread_gauge_mm


@pytest.mark.parametrize(
    ("gauges", "leg", "named"),
    [
        ("x", None, r"gauge x by \d\.\d+ mm\. Look"),
        ("z", None, r"gauge z by \d\.\d+ mm\. Look"),
        ("", 4, r"encoder 4 by 0\.600 mm"),
        ("xz", 2, r"gauge x by .*, gauge z by .*, encoder 2 by"),
    ],
)
async def test_what_never_settles_is_named(bench, gauges: str, leg: int | None, named: str) -> None:
    for name in gauges:
        bench.gauges["xyz".index(name)].shown = lambda: math.sin(3.0 * bench.clock.now())
    bench.encoders.shown = lambda: [bench.clock.now() * (number == leg) for number in range(1, 7)]
    with pytest.raises(DeviceError, match=f"within 20 s: {named}") as refusal:
        await settle(bench.devices, TIMING, bench.clock)
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert 20.0 < bench.clock.now() < 21.0


@pytest.mark.parametrize(
    "failures",
    [
        [[], [unsteady("y")] * 30, []],
        [[unsteady(name)] * 3 for name in "xyz"],
        [[unsteady("x")] * 3, [at_end("y")] * 3, []],
    ],
    ids=["one gauge", "all", "an oscillation to an end of the travel"],
)
async def test_unsteady_gauges_have_not_settled_yet(bench, failures: list[list[HexacellError]]) -> None:
    for gauge, errors in zip(bench.gauges, failures, strict=True):
        gauge.failures = list(errors)
    settled = await settle(bench.devices, TIMING, bench.clock)
    assert settled.window[0].at_s >= max(map(len, failures)) * TIMING.interval_s - 1e-9


async def test_a_gauge_that_stays_unsteady_is_named(bench) -> None:
    bench.gauges[2].failures = [unsteady("z")] * 1000
    with pytest.raises(DeviceError, match="within 20 s: gauge z: readings do not agree"):
        await settle(bench.devices, TIMING, bench.clock)


async def test_ends_of_the_travel_are_all_reported_at_once(bench) -> None:
    bench.gauges[0].shown = lambda: 9.0
    with pytest.raises(GaugeAtEnd):
        await settle(bench.devices, TIMING, bench.clock)
    bench.gauges[2].shown = lambda: -9.0
    with pytest.raises(SeveralErrors) as refusal:
        await settle(bench.devices, TIMING, bench.clock)
    assert [error.subject for error in refusal.value.errors] == ["gauge x", "gauge z"]
    assert bench.clock.now() == 0.0


async def test_other_failures_are_not_waited_out(bench) -> None:
    bench.gauges[0].failures = [GaugeSilent("does not answer", subject="gauge x")]
    with pytest.raises(GaugeSilent):
        await settle(bench.devices, TIMING, bench.clock)
    bench.gauges[0].failures = [GaugeSilent("does not answer", subject="gauge x")]
    bench.gauges[1].failures = [unsteady("y")]
    with pytest.raises(SeveralErrors):
        await settle(bench.devices, TIMING, bench.clock)
    bench.encoders.failure = DeviceError("no round", subject="encoders")
    with pytest.raises(DeviceError, match="encoders: no round"):
        await settle(bench.devices, TIMING, bench.clock)


async def test_slow_readings_that_agree_settle_after_the_time_limit(bench) -> None:
    """Readings that take long, or a machine that stalls, are no vibration."""
    slowed(bench, 25.0)
    settled = await settle(bench.devices, TIMING, bench.clock)
    assert bench.clock.now() > TIMING.give_up_s
    assert len(settled.window) == TIMING.readings


async def test_slow_readings_that_never_agree_end_too(bench) -> None:
    slowed(bench, 25.0, drift=1e-3)
    with pytest.raises(DeviceError, match="gauge x by"):
        await settle(bench.devices, TIMING, bench.clock)
    assert bench.gauges[0].reads == LEAST_WINDOWS * TIMING.readings


async def test_a_window_longer_than_the_time_allowed_is_reported(bench) -> None:
    timing = TIMING.model_copy(update={"window_s": 30.0})
    with pytest.raises(DeviceError, match="window of readings is longer"):
        await settle(bench.devices, timing, bench.clock)


async def test_encoders_are_read_while_gauges_are_and_the_skew_is_from_the_first_to_the_last(
    bench, monkeypatch
) -> None:
    has_sampled = asyncio.Event()

    class Moments:
        """A clock that goes on by 10 ms whenever it is read: at each answer."""

        read = 0

        def now(self) -> float:
            self.read += 1
            return 5.0 + 0.01 * self.read

    async def read_encoders() -> EncoderSample:
        has_sampled.set()
        return EncoderSample((0,) * 6, (0.0,) * 6)

    async def read_gauge() -> GaugeReading:
        await has_sampled.wait()
        return GaugeReading(0.5, "+0.500")

    monkeypatch.setattr(bench.encoders, "read", read_encoders)
    for gauge in bench.gauges:
        monkeypatch.setattr(gauge, "read", read_gauge)
    look = await read_all(bench.devices, cast("CellClock", Moments()))
    assert look.at_s == pytest.approx(5.04)
    assert look.skew_s == pytest.approx(0.03)


@pytest.mark.parametrize("count", [3, 4, 5, 7, 12])
@pytest.mark.parametrize("damage_mm", [-0.04, 0.04, 9.0])
def test_one_damaged_reading_is_not_in_the_mean(count: int, damage_mm: float) -> None:
    readings = np.tile([1.0, -2.0, 0.5], (count, 1))
    for row in range(count):
        damaged = readings.copy()
        damaged[row, 1] += damage_mm
        assert trimmed_mean(damaged) == pytest.approx([1.0, -2.0, 0.5])
    assert trimmed_mean(readings[:2]) == pytest.approx(readings[:2].mean(axis=0)), "all of two count"


@pytest.mark.parametrize(("count", "more"), [(5, 0.07), (12, 0.03)])
def test_a_trimmed_mean_scatters_little_more_than_a_mean(count: int, more: float) -> None:
    readings = np.random.default_rng(7).normal(size=(count, 100_000))
    assert trimmed_mean(readings).std() <= (1.0 + more) * readings.mean(axis=0).std()
