"""Devices are read for screens while a run waits for a person."""

from __future__ import annotations

import asyncio
from dataclasses import replace

from drivers.interfaces import GaugeReading
from hexacell.errors import DeviceError
from procedures.devices.device_set import LiveValues, poll_for_screens
from tests.waiting import until


async def test_every_device_is_read_again_and_again_whatever_fails(bench) -> None:
    live = LiveValues(bench.clock.now)
    devices = replace(bench.devices, live=live)
    bench.encoders.failure = DeviceError("is silent", subject="encoders")
    polling = asyncio.ensure_future(poll_for_screens(devices, period_s=0.0))
    await until(lambda: live.gauge("z").value is not None and live.encoders.problem != "")
    assert live.controller.value is not None
    assert live.stop_reason.value == ""
    bench.gauges[2].shown = lambda: 1.5
    await until(lambda: live.gauge("z").value == GaugeReading(1.5, "+1.500"))
    bench.clock.time_s += 10.0
    bench.encoders.failure = None
    polling.cancel()
    await asyncio.wait([polling])
    assert polling.cancelled()


async def test_what_somebody_else_reads_is_left_alone(bench) -> None:
    live = LiveValues(bench.clock.now)
    devices = replace(bench.devices, live=live)
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
    polling.cancel()
    await asyncio.wait([polling])
