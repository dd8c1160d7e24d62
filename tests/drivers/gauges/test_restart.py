"""A device that restarts when its port is opened is read: it is asked again."""

import asyncio

import pytest

from drivers.conformance import served_encoder_twin
from drivers.discovery import SearchTimeouts
from drivers.discovery.gauges import search_port
from drivers.encoders.modbus import ModbusBank
from drivers.errors import GaugeSilent
from drivers.gauges.digimatic_usb import DigimaticUsbGauge
from drivers.serial.modbus_port import ModbusPort
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.plugins import Group, load
from tests.drivers.simulated.gauges.served.cell import DESCRIBED, DISPLAYS, PROTOCOLS, cell
from tests.waiting import until

RESTART_S = 0.1
LATENCY_S = 0.03
VALUE = b"-1.234\n"


@pytest.mark.parametrize("protocol", [*PROTOCOLS, *DISPLAYS, *DESCRIBED])
async def test_every_gauge_is_opened_though_it_restarts_then(protocol, monkeypatch):
    monkeypatch.setattr("tests.drivers.simulated.gauges.served.cell.WORST_LATENCY_S", LATENCY_S)
    async with cell([protocol] * 3, timeout_s=0.25, restart_s=RESTART_S) as made:
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == pytest.approx(1.0, abs=0.01)


async def test_it_is_asked_until_it_has_had_its_time(dialogue, links, settings):
    gauge = DigimaticUsbGauge(settings("digimatic-usb", settle_s=0.2), links)
    dialogue.expect((b"\n", b""), (b"\n", b""), (b"\n", VALUE))
    await gauge.open()
    dialogue.expected += [(b"\n", b"")]
    with pytest.raises(GaugeSilent):
        await gauge.read()  # it was opened: now silence is silence


async def test_a_banner_is_no_answer(dialogue, links, settings):
    gauge = DigimaticUsbGauge(settings("digimatic-usb", settle_s=1.0), links)
    dialogue.expect(*[(b"\n", b"Digimatic reader 1.2\n")] * 5, (b"\n", VALUE))
    await gauge.open()


async def test_its_control_lines_are_those_of_the_cell_file(dialogue, links, settings):
    gauge = DigimaticUsbGauge(settings("digimatic-usb", serial={"dtr": False, "rts": False}), links)
    dialogue.expect((b"\n", VALUE))
    await gauge.open()
    assert (dialogue.dtr, dialogue.rts) == (False, False)


async def test_a_search_gives_microcontrollers_their_time():
    async with cell(["digimatic-usb"] * 3, restart_s=RESTART_S) as made:
        port = made.rack.gauges[0].port
        names = ("cdi", "digimatic-usb")
        found = await search_port(
            port, {name: load(Group.GAUGES, name) for name in names}, SearchTimeouts(gauge=0.1, restart=1.0)
        )
    assert [gauge.protocol for gauge in found.gauges] == ["digimatic-usb"]


async def test_modbus_encoders_are_asked_again_too(monkeypatch):
    asked: list[bytes] = []
    ask = ModbusPort._exchange_once

    def counted(port, request, *others):
        asked.append(request)
        port.worst_latency_s = 0.0  # nothing comes late here
        return ask(port, request, *others)

    monkeypatch.setattr(ModbusPort, "_exchange_once", counted)
    modbus = {"registers": (0, 2, 4, 6, 8, 10)}
    settings = LinearEncoderSettings.model_validate(
        {"protocol": "modbus", "modbus": modbus, "timeout_s": 0.05}
    )
    with served_encoder_twin(settings) as twin:
        twin.inject("silent", on=True)
        bank = ModbusBank(twin.settings)
        opening = asyncio.create_task(bank.open())
        await until(lambda: len(asked) > 1)
        twin.inject("silent", on=False)
        assert len(await opening) == 6
        await bank.close()
