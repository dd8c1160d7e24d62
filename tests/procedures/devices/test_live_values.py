"""Live values: the latest answer of every device with its age, whatever asked for it."""

import asyncio
from dataclasses import replace

import pytest

from drivers.interfaces import ControllerStatus, GaugeReading
from hexacell.errors import DeviceError
from procedures.devices.device_set import Devices, LiveValues, poll_for_screens
from procedures.guards.guards import Guards
from tests.waiting import cancel, until


@pytest.fixture
def live(bench) -> LiveValues:
    return LiveValues(bench.clock.now)


@pytest.fixture
def devices(live, bench) -> Devices:
    devices: Devices = bench.devices
    return replace(devices, live=live)


async def test_every_answer_is_kept_with_its_age(live, devices, bench) -> None:
    bench.gauges[0].shown = lambda: 1.25
    await devices.read_gauge_once(devices.gauges[0].gauge)
    await bench.clock.sleep(2.0)
    await devices.controller_status()
    shown = live.gauge("x")
    assert shown.value is not None
    assert (shown.value.value_mm, shown.age_s) == (1.25, 2.0)
    assert (live.controller.value, live.controller.age_s) == (bench.controller.now, 0.0)
    assert live.gauge("y").value is None


async def test_a_failure_is_kept_with_the_age_of_the_last_value(live, devices, bench) -> None:
    await devices.read_encoders()
    bench.encoders.failure = DeviceError("is silent", subject="encoders")
    await bench.clock.sleep(1.0)
    with pytest.raises(DeviceError):
        await devices.read_encoders()
    failed = live.encoders
    assert (failed.age_s, failed.problem) == (1.0, "encoders: is silent")
    assert failed.value is not None
    bench.encoders.failure = None
    await devices.read_encoders()
    assert live.encoders.problem == ""


async def test_values_polled_by_the_guards_are_published(make_rig) -> None:
    rig = make_rig()
    live = LiveValues(rig.clock.now)
    rig.folder.path.mkdir()
    devices = replace(rig.bench.devices, live=live)
    config = rig.performer.current_config
    guards = Guards(rig.cell.settings, devices, rig.clock, rig.folder.path, config)
    await guards.at_standstill(lambda: asyncio.sleep(0))
    assert live.encoders.value is not None
    assert live.controller.value == ControllerStatus(estop=False, enabled=True)
    assert live.stop_reason.value == ""


async def test_a_slow_subscriber_gets_the_latest_and_no_older_ones(live, devices, bench) -> None:
    changes = live.changes(period_s=0.0)
    first = asyncio.ensure_future(anext(changes))
    await asyncio.sleep(0)
    for value in range(1000):
        bench.gauges[0].shown = lambda shown=value / 1000: shown
        await devices.read_gauge_once(devices.gauges[0].gauge)
    await first
    shown = live.gauge("x").value
    assert shown is not None
    assert shown.value_mm == 0.999
    second = asyncio.ensure_future(anext(changes))
    for _ in range(5):
        await asyncio.sleep(0)
    assert not second.done(), "nothing has changed since"
    await devices.read_encoders()
    await second
    assert live.encoders.value is not None
    await changes.aclose()
    assert not live._subscribers


async def test_every_device_is_read_again_and_again_whatever_fails(live, devices, bench) -> None:
    bench.encoders.failure = DeviceError("is silent", subject="encoders")
    polling = asyncio.ensure_future(poll_for_screens(devices, period_s=0.0))
    await until(lambda: live.gauge("z").value is not None and live.encoders.problem != "")
    assert live.controller.value is not None
    assert live.stop_reason.value == ""
    bench.gauges[2].shown = lambda: 1.5
    await until(lambda: live.gauge("z").value == GaugeReading(1.5, "+1.500"))
    bench.clock.time_s += 10.0
    bench.encoders.failure = None
    await cancel(polling)


async def test_what_somebody_else_reads_is_left_alone(live, devices, bench) -> None:
    reads = 0

    def shown() -> float:
        nonlocal reads
        reads += 1
        return 0.0

    bench.gauges[0].shown = shown
    await devices.read_gauge_once(devices.gauges[0].gauge)
    polling = asyncio.ensure_future(poll_for_screens(devices, period_s=0.001))
    await until(lambda: live.gauge("y").value is not None)
    for _ in range(50):
        await asyncio.sleep(0)
    assert reads == 1, "its value is as young as it was: the clock stands"
    bench.clock.time_s += 1.0
    await until(lambda: reads > 1)
    await cancel(polling)
