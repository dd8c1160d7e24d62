"""Gauges with Modbus RTU on pseudo-terminals: registers, words, exceptions, faults of the line."""

import asyncio
import sys
from typing import Any

import pytest

from drivers.errors import GaugeAtEnd
from drivers.gauges.described import ModbusGauge
from drivers.simulated.gauges.described import crc
from hexacell.cell.described_devices import ModbusSettings
from hexacell.errors import DeviceError, UsageError
from tests.drivers.simulated.gauges.served.cell import cell


def bench(transport: str = "pty", **modbus: Any) -> Any:
    """Three gauges on one line, at 1, 2 and 3 mm: two registers of device 7, one of device 8."""
    places = [(7, 100), (7, 102), (8, 100)]

    def stated(_protocol: str, number: int) -> dict[str, Any]:
        device, register = places[number - 1]
        return {"modbus": {"device": device, "register": register, **modbus}}

    return cell(["modbus"] * 3, transport, 0.5, stated)


def other(made: Any, **modbus: Any) -> ModbusGauge:
    """A driver for another place than there is."""
    found = ModbusSettings.model_validate({"device": 7, "register": 100, **modbus})
    return ModbusGauge(made.rack.gauges[0].model_copy(update={"modbus": found}), made.links)


def test_the_checksum_of_the_simulation_is_that_of_the_specification():
    assert crc(bytes.fromhex("02 07")) == bytes.fromhex("41 12")
    assert crc(bytes.fromhex("01 04 00 00 00 02")) == bytes.fromhex("71 cb")


@pytest.mark.parametrize("transport", ["pty", "socket"])
async def test_three_gauges_on_one_line_are_read_at_once(transport):
    async with bench(transport=transport) as made:
        for gauge in made.gauges.values():
            await gauge.open()
        made.balls["y"] = -2.125
        readings = await asyncio.gather(*(gauge.read() for gauge in made.gauges.values()))
        assert [reading.value_mm for reading in readings] == pytest.approx([1.0, -2.125, 3.0])
        assert readings[0].raw == "0000 03e8 = 1000"
        for gauge in made.gauges.values():
            await gauge.check()


async def test_the_frames_are_those_of_the_specification_and_in_the_trace():
    async with bench() as made:
        await made.gauges["x"].open()
        await made.gauges["x"].close()
        frames = [entry.data for entry in made.trace.entries()]
        request = bytes.fromhex("07 04 00 64 00 02")
        answer = bytes.fromhex("07 04 04 00 00 03 e8")
        assert frames[0] == request + crc(request)
        assert b"".join(frames[1:]).startswith(answer + crc(answer))


@pytest.mark.parametrize(
    "modbus",
    [
        {"word_order": "little"},
        {"kind": "holding"},
        {"type": "int16", "mm_per_unit": 0.01},
        {"type": "float32", "mm_per_unit": 1.0},
        {"type": "float32", "mm_per_unit": 1000.0, "word_order": "little"},
    ],
)
async def test_numbers_are_what_the_cell_file_says(modbus):
    async with bench(**modbus) as made:
        made.balls["x"] = -1.5
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == pytest.approx(-1.5)


async def test_a_register_that_is_not_there_is_told():
    message = r"device 7 answers exception 2 \(illegal data address\)"
    async with bench() as made:
        with pytest.raises(DeviceError, match=message):
            await other(made, register=999).open()


async def test_a_number_that_means_an_end_is_told():
    async with bench(at_end=(0x7FFFFFFF,)) as made:
        await made.gauges["x"].open()
        made.rack.faults("x")["at its end"](on=True)
        with pytest.raises(GaugeAtEnd, match="gauge x: shows 2147483647, as at an end"):
            await made.gauges["x"].read()


async def test_without_the_extra_the_command_that_installs_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymodbus", None)
    async with bench() as made:
        with pytest.raises(UsageError, match=r"Type: pip install 'hexacell\[modbus\]'"):
            await made.gauges["x"].open()
