"""Temperatures are in every record; a thermometer that fails never ends a run."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from drivers.interfaces import DeviceIdentity, TemperatureReading
from hexacell.errors import DeviceError
from procedures.calibration.calibration import Mode
from procedures.devices.device_set import Thermometers
from procedures.journal.journal import read_journal
from procedures.run.readings import Temperature
from procedures.steps import events


class FakeThermometer:
    """One that shows what stands in a list, the last of it for ever."""

    def __init__(self, name: str, *shown: float | Exception) -> None:
        self.name = name
        self.shown = list(shown)
        self.closed = 0

    async def open(self) -> DeviceIdentity:
        await self.read()
        return DeviceIdentity(f"thermometer {self.name}", "fake", "a thermometer")

    async def read(self) -> TemperatureReading:
        shown = self.shown.pop(0) if len(self.shown) > 1 else self.shown[0]
        if isinstance(shown, Exception):
            raise shown
        return TemperatureReading(shown, f"{1000 * shown:.0f}")

    async def close(self) -> None:
        self.closed += 1


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
