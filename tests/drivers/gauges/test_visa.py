"""Instruments with SCPI are read on sockets and pseudo-terminals; another setting or device is told."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping
from typing import Any
from unittest.mock import Mock

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, PortLost, WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges.visa import VisaGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.described_devices import VisaSettings
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, UsageError
from tests.drivers.simulated.gauges.served.cell import cell

SCPI = VisaSettings(ask="READ? (@{channel})", mm_per_unit=1000.0, expect={"UNIT:LENG?": "M", "AVER?": "4"})


def bench(transport: str = "socket") -> Any:
    """Three inputs of one simulated instrument, at 1, 2 and 3 mm, and their drivers."""
    return cell(["visa"] * 3, transport, 0.5, lambda _protocol, _number: {"visa": SCPI})


def answers(made: Any, changed: Mapping[bytes, bytes]) -> None:
    """Other answers to some questions, from now on."""
    instrument = made.rack.lines["x"].instrument
    answer = type(instrument).answer.__get__(instrument)
    instrument.answer = lambda command: changed.get(command, answer(command))


@pytest.mark.parametrize("transport", ["socket", "pty"])
async def test_three_inputs_of_one_instrument_are_read_at_once(transport):
    async with bench(transport) as made:
        for gauge in made.gauges.values():
            assert (await gauge.open()).description == "HEXACELL,SIMULATED,0,1"
        made.balls["y"] = -2.125
        readings = await asyncio.gather(*(gauge.read() for gauge in made.gauges.values()))
        assert [reading.value_mm for reading in readings] == pytest.approx([1.0, -2.125, 3.0], abs=1e-6)
        assert str(made.rack.gauges[0].port).startswith("TCPIP" if transport == "socket" else "ASRL")
        for gauge in made.gauges.values():
            await gauge.check()


async def test_another_setting_than_expected_is_told_at_opening_and_afterwards():
    async with bench() as made:
        x = made.gauges["x"]
        await x.open()
        answers(made, {b"UNIT:LENG?": b"IN\n"})
        with pytest.raises(WrongSetting, match=r"gauge x: answers UNIT:LENG\? IN, not M"):
            await x.check()
        await x.close()
        with pytest.raises(WrongSetting, match="IN, not M"):
            await x.open()


async def test_numbers_are_compared_as_numbers():
    async with bench() as made:
        answers(made, {b"AVER?": b"+4.00000E+00\n"})
        await made.gauges["x"].open()


async def test_another_instrument_voids_the_zero():
    async with bench() as made:
        await made.gauges["x"].open()
        answers(made, {b"*IDN?": b"HEXACELL,SIMULATED,1,1\n"})
        with pytest.raises(ZeroVoid, match="identification"):
            await made.gauges["x"].check()


@pytest.mark.parametrize(
    ("answer", "error", "message"),
    [
        (b"9.9E37\n", GaugeAtEnd, "gauge x: is out of its range"),
        (b"-9.90000000E+37\n", GaugeAtEnd, "gauge x: is out of its range"),
        (b"9.91E37\n", DeviceError, "gauge x: has no value"),
        (b'-113,"Undefined header"\n', WrongAnswer, "does not know the question. Correct protocol, or"),
        (b"+1.0E-03", WrongAnswer, "ends with nothing, where LF is expected"),
        (b"", GaugeSilent, "gauge x: does not answer within 0.5 s"),
    ],
)
async def test_what_is_no_value_is_told(answer, error, message):
    async with bench() as made:
        await made.gauges["x"].open()
        answers(made, {b"READ? (@1)": answer})
        with pytest.raises(error, match=message):
            await made.gauges["x"].read()
        answers(made, {})
        assert (await made.gauges["x"].read()).value_mm == pytest.approx(1.0)


async def test_a_resource_that_is_not_there_is_told():
    settings = GaugeSettings(name="x", axis="x", protocol="visa", visa=SCPI, port="ASRL/dev/nowhere::INSTR")
    with pytest.raises(PortLost, match="gauge x: port /dev/nowhere is absent"):
        await VisaGauge(settings, SharedSerialPorts()).open()


ABSENT, LOCKED = (ValueError("install PyUSB"), OSError("No VISA library")), PermissionError(13, "")


@pytest.mark.parametrize("error", [*ABSENT, LOCKED])
async def test_why_a_resource_cannot_be_opened_decides_the_advice(monkeypatch, error):
    library = pytest.importorskip("pyvisa")
    monkeypatch.setattr(library, "ResourceManager", Mock(side_effect=error))
    settings = GaugeSettings(name="x", axis="x", protocol="visa", visa=SCPI, port="USB::1::2::3::INSTR")
    with pytest.raises(PortLost, match="its rights" if error is LOCKED else "Install what it names"):
        await VisaGauge(settings, SharedSerialPorts()).open()


async def test_without_the_extra_the_command_that_installs_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    settings = GaugeSettings(name="x", axis="x", protocol="visa", visa=SCPI, port="USB::1::2::3::INSTR")
    ports = SharedSerialPorts()
    with pytest.raises(UsageError, match=r"needs pyvisa, .*Type: pip install 'hexacell\[visa\]'"):
        await VisaGauge(settings, ports).open()
    await ports.close()


class Usb:
    """What PyVISA opens for an instrument on USB: it answers every question with the next message."""

    def __init__(self, library: Any) -> None:
        self.answers = [b"HEXACELL,USB,0,1\n", b"M\n", b"4\n"]
        self.library, self.cleared, self.timeout = library, 0, 0.0

    def open_resource(self, _name: str) -> Usb:
        return self

    def write_raw(self, _request: bytes) -> None:
        """Nothing is done with it."""

    def read_raw(self) -> bytes:
        if not self.answers:
            raise self.library.errors.VisaIOError(self.library.constants.StatusCode.error_timeout)
        return self.answers.pop(0)

    def clear(self) -> None:
        self.cleared += 1

    def close(self) -> None:
        """Nothing is open."""


async def test_an_instrument_with_messages_is_cleared_after_one_did_not_come(monkeypatch):
    library = pytest.importorskip("pyvisa")
    instrument = Usb(library)
    monkeypatch.setattr(library, "ResourceManager", lambda _backend: instrument)
    settings = GaugeSettings(name="x", axis="x", protocol="visa", visa=SCPI, port="USB::1::2::3::INSTR")
    gauge = VisaGauge(settings, SharedSerialPorts())
    assert (await gauge.open()).description == "HEXACELL,USB,0,1"
    with pytest.raises(GaugeSilent):
        await gauge.read()
    instrument.answers = [b"1.0E-03\n"] * 2
    assert (await gauge.read()).value_mm == pytest.approx(1.0)
    assert instrument.cleared == 1
    await gauge.close()
