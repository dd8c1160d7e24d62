"""Snapshots of live values: what is shown, how old it is, and how noisy at standstill."""

import pytest

from drivers.interfaces import ControllerStatus, EncoderSample, GaugeReading
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError
from hexacell.run_process.live_devices import NOISE_READINGS, LiveFeed
from procedures.devices.device_set import LiveValues
from tests.procedures.fakes import ManualClock

GAUGE = GaugeSettings(name="left", axis="y", sign=-1, protocol="sylvac", travel_mm=10.0, middle_mm=5.0)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def live(clock) -> LiveValues:
    return LiveValues(clock.now)


@pytest.fixture
def feed(live) -> LiveFeed:
    return LiveFeed(live, [GAUGE])


async def read(live: LiveValues, value_mm: float) -> None:
    async def answer() -> GaugeReading:
        return GaugeReading(value_mm, str(value_mm))

    await live.gauge("left").of(answer)


async def test_before_the_first_answer_nothing_is_shown(feed) -> None:
    snapshot = feed.snapshot()
    (gauge,) = snapshot.gauges
    assert (gauge.shown_mm, gauge.age_s, gauge.noise_mm, gauge.problem) == (None, None, None, "")
    assert (gauge.name, gauge.axis, gauge.sign, gauge.travel_mm, gauge.middle_mm) == (
        "left", "y", -1, 10.0, 5.0,
    )  # fmt: skip
    assert (snapshot.encoders.value, snapshot.controller.value) == (None, None)


async def test_each_device_has_its_value_and_age(feed, live, clock) -> None:
    await read(live, 1.25)

    async def positions() -> EncoderSample:
        return EncoderSample((1,) * 6, (0.5,) * 6)

    async def status() -> ControllerStatus:
        return ControllerStatus(estop=True, enabled=False, error_messages=("joint 3",))

    async def forbidden() -> str:
        return "the stop file is there"

    await live.encoders.of(positions)
    clock.time_s += 3.0
    await live.controller.of(status)
    await live.stop_reason.of(forbidden)
    snapshot = feed.snapshot()
    assert (snapshot.gauges[0].shown_mm, snapshot.gauges[0].age_s) == (1.25, 3.0)
    assert snapshot.encoders.value is not None
    assert (snapshot.encoders.value.positions, snapshot.encoders.age_s) == ((0.5,) * 6, 3.0)
    controller = snapshot.controller.value
    assert controller is not None
    assert (controller.estop, controller.enabled, controller.error_messages) == (True, False, ("joint 3",))
    assert (snapshot.controller.age_s, snapshot.stop_reason) == (0.0, "the stop file is there")


async def test_a_failure_is_shown_with_the_last_value(feed, live) -> None:
    async def fails() -> GaugeReading:
        raise DeviceError("answers in inch", subject="gauge left", action="Press in/mm")

    await read(live, 1.0)
    with pytest.raises(DeviceError):
        await live.gauge("left").of(fails)
    (gauge,) = feed.snapshot().gauges
    assert (gauge.shown_mm, gauge.problem) == (1.0, "gauge left: answers in inch. Press in/mm")


async def shown_noise(feed: LiveFeed, live: LiveValues, clock: ManualClock, *values: float) -> float | None:
    for value in values:
        clock.time_s += 0.1
        await read(live, value)
        feed.snapshot()
    noise: float | None = feed.snapshot().gauges[0].noise_mm
    return noise


async def test_noise_is_the_deviation_of_the_latest_readings(feed, live, clock) -> None:
    assert await shown_noise(feed, live, clock, 0.0, 0.002, 0.0, 0.002) is None
    for _ in range(NOISE_READINGS):  # a reading that is shown twice counts once
        assert feed.snapshot().gauges[0].noise_mm is None
    assert await shown_noise(feed, live, clock, *[0.0, 0.002] * 50) == pytest.approx(
        0.001 * (10 / 9) ** 0.5
    )


async def test_motion_is_no_noise(feed, live, clock) -> None:
    await shown_noise(feed, live, clock, *[0.0, 0.002] * 5)
    feed.is_moving = True
    assert await shown_noise(feed, live, clock, 1.0, 2.0, 3.0) is None
    feed.is_moving = False
    assert await shown_noise(feed, live, clock, 5.0, 5.0, 5.0, 5.0, 5.0) == 0.0
