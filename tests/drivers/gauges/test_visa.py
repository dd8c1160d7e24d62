"""Instruments with SCPI, through PyVISA's pure-Python backend, on sockets and pseudo-terminals."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, PortLost, WrongAnswer, WrongSetting, ZeroVoid
from drivers.gauges.visa import VisaGauge
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from hexacell.cell.described_devices import VisaSettings
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, FileError, UsageError

SCPI = VisaSettings(ask="READ? (@{channel})", mm_per_unit=1000.0, expect={"UNIT:LENG?": "M", "AVER?": "4"})
WORST_LATENCY_S = 0.1
FAST = 100.0


class Bench:
    """Three inputs of one simulated instrument, at 1, 2 and 3 mm, and their drivers."""

    def __init__(self, transport: str, settings: VisaSettings = SCPI) -> None:
        self.balls = {"x": 1.0, "y": 2.0, "z": 3.0}
        gauges = [
            GaugeSettings(
                name=name, axis=name, protocol="visa", channel=channel, visa=settings, timeout_s=0.5
            )
            for channel, name in enumerate(self.balls, 1)
        ]
        plungers = {name: lambda name=name: self.balls[name] for name in self.balls}
        simulated = SimulatedGauges.model_validate({"transport": transport})
        self.bank = SimulatedGaugeBank(gauges, plungers, simulated, CellClock(FAST))
        self.ports = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
        self.gauges = [VisaGauge(gauge, self.ports) for gauge in self.bank.gauges]

    @property
    def instrument(self) -> Any:
        return self.bank.line("x").instrument

    def answers(self, changed: Mapping[bytes, bytes]) -> None:
        """Other answers to some questions, from now on."""
        answer = type(self.instrument).answer.__get__(self.instrument)
        self.instrument.answer = lambda command: changed.get(command, answer(command))


@contextmanager
def bench(transport: str = "socket", **changes: Any) -> Iterator[Bench]:
    made = Bench(transport, SCPI.model_copy(update=changes))
    try:
        yield made
    finally:
        made.bank.close()


@pytest.mark.parametrize("transport", ["socket", "pty"])
async def test_three_inputs_of_one_instrument_are_read_at_once(transport):
    with bench(transport) as cell:
        for gauge in cell.gauges:
            assert (await gauge.open()).description == "HEXACELL,SIMULATED,0,1"
        cell.balls["y"] = -2.125
        readings = await asyncio.gather(*(gauge.read() for gauge in cell.gauges))
        assert [reading.value_mm for reading in readings] == pytest.approx([1.0, -2.125, 3.0], abs=1e-6)
        assert str(cell.gauges[0].settings.port).startswith("TCPIP" if transport == "socket" else "ASRL")
        for gauge in cell.gauges:
            await gauge.check()
            await gauge.close()


async def test_another_setting_than_expected_is_told_at_opening_and_afterwards():
    with bench() as cell:
        [x, *_] = cell.gauges
        await x.open()
        cell.answers({b"UNIT:LENG?": b"IN\n"})
        with pytest.raises(
            WrongSetting, match=r"gauge x: answers UNIT:LENG\? IN, not M. Set the instrument"
        ):
            await x.check()
        await x.close()
        with pytest.raises(WrongSetting, match="IN, not M"):
            await x.open()


async def test_numbers_are_compared_as_numbers():
    with bench() as cell:
        cell.answers({b"AVER?": b"+4.00000E+00\n"})
        await cell.gauges[0].open()
        await cell.gauges[0].close()


async def test_another_instrument_voids_the_zero():
    with bench() as cell:
        await cell.gauges[0].open()
        cell.answers({b"*IDN?": b"HEXACELL,SIMULATED,1,1\n"})
        with pytest.raises(ZeroVoid, match="identification"):
            await cell.gauges[0].check()
        await cell.gauges[0].close()


@pytest.mark.parametrize(
    ("answer", "error", "message"),
    [
        (b"9.9E37\n", GaugeAtEnd, "gauge x: is out of its range"),
        (b"-9.90000000E+37\n", GaugeAtEnd, "gauge x: is out of its range"),
        (b"9.91E37\n", DeviceError, "gauge x: has no value"),
        (b'-113,"Undefined header"\n', WrongAnswer, "where protocol visa has answers like"),
        (b"+1.0E-03", WrongAnswer, "where protocol visa has answers like"),
        (b"", GaugeSilent, "gauge x: does not answer within 0.5 s"),
    ],
)
async def test_what_is_no_value_is_told(answer, error, message):
    with bench() as cell:
        await cell.gauges[0].open()
        cell.answers({b"READ? (@1)": answer})
        with pytest.raises(error, match=message):
            await cell.gauges[0].read()
        cell.answers({})
        assert (await cell.gauges[0].read()).value_mm == pytest.approx(1.0)
        await cell.gauges[0].close()


async def test_a_resource_that_is_not_there_is_told():
    settings = GaugeSettings(name="x", axis="x", protocol="visa", visa=SCPI, port="ASRL/dev/nowhere::INSTR")
    with pytest.raises(PortLost, match="gauge x: port ASRL/dev/nowhere::INSTR cannot be opened"):
        await VisaGauge(settings, SharedSerialPorts()).open()


async def test_without_the_extra_the_command_that_installs_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    settings = GaugeSettings(
        name="x", axis="x", protocol="visa", visa=SCPI, port="TCPIP::127.0.0.1::1::SOCKET"
    )
    ports = SharedSerialPorts()
    with pytest.raises(UsageError, match=r"needs pyvisa, .*Type: pip install 'hexacell\[visa\]'"):
        await VisaGauge(settings, ports).open()
    await ports.close()


def test_a_gauge_that_is_not_described_is_an_error_of_the_cell_file():
    with pytest.raises(FileError, match="gauge x: does not say what is asked"):
        VisaGauge(GaugeSettings(name="x", axis="x", protocol="visa"), SharedSerialPorts())
