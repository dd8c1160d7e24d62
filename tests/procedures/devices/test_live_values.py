"""Live values: the latest answer of every device with its age, sampled, whoever asked for it."""

from __future__ import annotations

import asyncio
import math

import pytest

from drivers.interfaces import ControllerStatus
from hexacell.cell.limits import TimingSettings
from hexacell.errors import DeviceError
from procedures.devices.live_values import LiveValues
from procedures.devices.settling import settle
from procedures.guards.guards import Guards
from procedures.run import events
from procedures.run.state import fold
from procedures.run.steps import Compute


@pytest.fixture
def live(bench) -> LiveValues:
    return LiveValues(bench.clock.now)


async def test_nothing_is_known_before_the_first_answer(live, bench) -> None:
    live.observe(bench.devices)
    snapshot = live.snapshot()
    assert set(snapshot.gauges) == {"x", "y", "z"}
    for value in (*snapshot.gauges.values(), snapshot.encoders, snapshot.controller, snapshot.stop_reason):
        assert value.value is None
        assert math.isinf(value.age_s)


async def test_every_answer_is_kept_with_its_age(live, bench) -> None:
    devices = live.observe(bench.devices)
    bench.gauges[0].shown = lambda: 1.25
    await devices.gauges[0].gauge.read_once()
    await bench.clock.sleep(2.0)
    await devices.controller.status()
    snapshot = live.snapshot()
    shown = snapshot.gauges["x"]
    assert shown.value is not None
    assert (shown.value.value_mm, shown.age_s) == (1.25, 2.0)
    assert (snapshot.controller.value, snapshot.controller.age_s) == (bench.controller.now, 0.0)
    assert snapshot.gauges["y"].value is None


async def test_a_failure_is_said_and_the_last_value_grows_older(live, bench) -> None:
    devices = live.observe(bench.devices)
    await devices.encoders.read()
    bench.encoders.failure = DeviceError("is silent", subject="encoders")
    await bench.clock.sleep(1.0)
    with pytest.raises(DeviceError):
        await devices.encoders.read()
    failed = live.snapshot().encoders
    assert (failed.age_s, failed.problem) == (1.0, "encoders: is silent")
    assert failed.value is not None
    bench.encoders.failure = None
    await devices.encoders.read()
    assert live.snapshot().encoders.problem == ""


async def test_records_are_read_through_it_unchanged(live, bench) -> None:
    timing = TimingSettings()
    settled = await settle(live.observe(bench.devices), timing, bench.clock)
    assert settled.gauge_means().tolist() == [0.0, 0.0, 0.0]
    assert live.snapshot().encoders.value == settled.window[-1].encoders


async def test_what_the_guards_poll_is_seen(make_rig) -> None:
    rig = make_rig()
    live = LiveValues(rig.clock.now)
    rig.folder.path.mkdir()
    devices = live.observe(rig.bench.devices)
    guards = Guards(rig.cell.settings, devices, rig.clock, rig.folder.path)
    await guards.at_standstill(lambda: asyncio.sleep(0))
    snapshot = live.snapshot()
    assert snapshot.encoders.value is not None
    assert snapshot.controller.value == ControllerStatus(estop=False, enabled=True)
    assert snapshot.stop_reason.value == ""


async def test_a_slow_subscriber_gets_the_latest_and_nothing_piles_up(live, bench) -> None:
    devices = live.observe(bench.devices)
    changes = live.changes(period_s=0.0)
    first = asyncio.ensure_future(anext(changes))
    await asyncio.sleep(0)
    for value in range(1000):
        bench.gauges[0].shown = lambda shown=value / 1000: shown
        await devices.gauges[0].gauge.read_once()
    shown = (await first).gauges["x"].value
    assert shown is not None
    assert shown.value_mm == 0.999
    second = asyncio.ensure_future(anext(changes))
    for _ in range(5):
        await asyncio.sleep(0)
    assert not second.done(), "nothing has changed since"
    await devices.encoders.read()
    assert (await second).encoders.value is not None
    await changes.aclose()
    assert not live._subscribers


async def test_a_run_can_be_watched(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    live = LiveValues(rig.clock.now)
    object.__setattr__(rig.performer, "devices", live.observe(rig.bench.devices))
    state = fold(recording.until(events.Proposed))
    await rig.performer.perform(Compute(kind="commit"), state)
    assert live.snapshot().encoders.value is not None, "guards watch while the controller reloads"
