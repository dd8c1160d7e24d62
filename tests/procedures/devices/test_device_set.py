"""All devices together: failures are named at once; one that answers again must be the one of before."""

import asyncio
import logging
from dataclasses import replace
from typing import Any

import pytest

from drivers.errors import GaugeSilent
from drivers.interfaces import DeviceIdentity
from hexacell.errors import DeviceError, ExitCode, SeveralErrors
from procedures.calibration.calibration import Mode
from procedures.devices.device_set import Thermometers, gather_errors
from procedures.devices.reconnection import DeviceReplaced, require_known
from procedures.journal.journal import read_journal
from procedures.run.readings import Temperature
from procedures.steps import events
from tests.procedures.fakes import FakeThermometer
from tests.waiting import cancel, until


async def test_all_devices_that_cannot_be_opened_are_named_at_once(bench) -> None:
    bench.gauges[1].dead = GaugeSilent("does not answer", subject="gauge y")
    bench.encoders.dead = DeviceError("node 3 is absent", subject="encoders")
    bench.controller.dead = DeviceError("refuses the connection", subject="controller")
    with pytest.raises(SeveralErrors) as refusal:
        await bench.devices.open()
    assert [error.subject for error in refusal.value.errors] == ["gauge y", "encoders", "controller"]
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert all(subject in str(refusal.value) for subject in ("gauge y", "encoders", "controller"))


async def test_the_others_are_closed_after_a_failure(bench, monkeypatch) -> None:
    async def broken() -> None:
        raise DeviceError("cannot be closed")

    monkeypatch.setattr(bench.gauges[0], "close", broken)
    monkeypatch.setattr(bench.encoders, "close", broken)
    await bench.devices.close()
    assert [bench.gauges[1].closed, bench.gauges[2].closed, bench.controller.closed] == [1, 1, 1]


async def answer(value: int | BaseException) -> int:
    await asyncio.sleep(0)
    if isinstance(value, BaseException):
        raise value
    return value


async def test_every_call_ends_before_an_error_is_raised() -> None:
    ended: list[int] = []

    async def slow() -> int:
        for _ in range(5):
            await asyncio.sleep(0)
        ended.append(1)
        return 1

    with pytest.raises(DeviceError):
        await gather_errors("no", [answer(DeviceError("broken")), slow()])
    assert ended == [1]


async def test_a_programming_error_is_not_hidden_behind_others() -> None:
    with pytest.raises(ZeroDivisionError):
        await gather_errors("no", [answer(DeviceError("broken")), answer(ZeroDivisionError())])


async def test_cancelling_cancels_every_call() -> None:
    begun: list[int] = []
    cancelled: list[int] = []

    async def forever(number: int) -> None:
        begun.append(number)
        try:
            await asyncio.Event().wait()
        finally:
            cancelled.append(number)

    task = asyncio.create_task(gather_errors("no", [forever(1), forever(2)]))
    await until(lambda: len(begun) == 2)
    await cancel(task)
    assert cancelled == [1, 2]


GONE = DeviceError("cannot be read", subject="thermometer rails", action="Check it")


async def test_all_thermometers_are_read_in_their_order() -> None:
    thermometers = Thermometers([FakeThermometer("room", 20.5), FakeThermometer("rails", -1.0)])
    assert [identity.name for identity in await thermometers.open()] == [
        "thermometer room",
        "thermometer rails",
    ]
    assert await thermometers.read() == (
        Temperature(name="room", celsius=20.5, raw="20500"),
        Temperature(name="rails", celsius=-1.0, raw="-1000"),
    )


@pytest.mark.parametrize("failure", [GONE, ZeroDivisionError("in a stranger's driver")])
async def test_a_failing_thermometer_gives_no_temperature_and_one_warning(caplog, failure):
    rails = FakeThermometer("rails", failure, failure, failure, 21.0, failure)
    thermometers = Thermometers([rails, FakeThermometer("room", 20.5)])
    with caplog.at_level(logging.WARNING):
        assert [identity.name for identity in await thermometers.open()] == ["thermometer room"]
        first = await thermometers.read()
        await thermometers.read()
        assert len(caplog.records) == 1
        assert [found.celsius for found in await thermometers.read()] == [21.0, 20.5]
        await thermometers.read()
    assert [found.celsius for found in first] == [None, 20.5]
    assert first[0].problem
    assert len(caplog.records) == 2, "it came back in between"
    assert "Records are taken without this temperature" in caplog.records[0].getMessage()


async def test_every_record_of_a_run_has_the_temperatures(make_rig, caplog) -> None:
    rig: Any = make_rig(Mode.CHECK)
    room = FakeThermometer("room", 20.5)
    rails = FakeThermometer("rails", 20.0, 20.0, GONE)
    object.__setattr__(rig.performer, "thermometers", Thermometers([room, rails]))
    await rig.run()
    history = read_journal(rig.folder.journal)
    readings = [
        event.reading for event in history if isinstance(event, events.RecordTaken | events.SetClosed)
    ]
    assert len(readings) > 3
    for number, reading in enumerate(readings):
        assert reading is not None
        assert [found.name for found in reading.temperatures] == ["room", "rails"]
        assert reading.temperatures[0].celsius == 20.5
        assert (reading.temperatures[1].celsius is None) == (number >= 2)
    assert [record.levelname for record in caplog.records].count("WARNING") == 1


BEFORE = DeviceIdentity(
    "x", "mux10", "Mitutoyo MUX-10 channel", settings="preset 0", port="USB 0403:6001 socket 1-1"
)


@pytest.mark.parametrize(
    "change",
    [
        {"port": "USB 0403:6001 socket 1-2"},
        {"settings": "preset 500"},
        {"description": "another"},
        {"serial_number": "7"},
    ],
)
def test_another_port_or_setting_is_another_device(change: dict[str, str]) -> None:
    now = replace(BEFORE, **change)
    with pytest.raises(DeviceReplaced, match=next(iter(change.values()))):
        require_known([now], [BEFORE])


@pytest.mark.parametrize(("remark", "before"), [("", {"settings": "", "port": ""}), ("a warning", {})])
def test_what_a_journal_of_before_does_not_tell_is_not_compared_nor_a_remark(remark, before) -> None:
    require_known([replace(BEFORE, remark=remark)], [replace(BEFORE, **before)])
