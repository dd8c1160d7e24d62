"""Faults of the line: answers that are late, garbled or missing, and the plug."""

import asyncio
import contextlib
import logging

import pytest

from drivers.errors import GaugeSilent, GaugeUnsteady, WrongAnswer, ZeroVoid
from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from drivers.simulated.gauges.faults import InjectedGaugeFault
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError
from tests.drivers.simulated.gauges.served.cell import (
    DRIVERS,
    FAST,
    PROTOCOLS,
    TIMEOUT_S,
    TRANSPORTS,
    ask,
    cell,
    questions_to,
    served,
)
from tests.waiting import until


async def test_silent(sylvac):
    sylvac.rack.inject("y", InjectedGaugeFault.SILENT)
    with pytest.raises(GaugeSilent, match="gauge y"):
        await sylvac.gauges["y"].read()
    sylvac.rack.clear("y", InjectedGaugeFault.SILENT)
    assert await sylvac.values() == [1.0, 2.0, 3.0]


async def test_a_late_answer_is_never_the_next_reading(sylvac):
    late_s = (TIMEOUT_S + 0.1) * FAST
    sylvac.rack.inject("y", InjectedGaugeFault.LATE, answers=1, seconds=late_s)
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["y"].read()
    sylvac.balls["y"] = 5.0
    assert (await sylvac.gauges["y"].read()).value_mm == 5.0
    await sylvac.gauges["y"].check()


async def test_cancelled_readings_leave_the_line_in_step(sylvac):
    questions = questions_to(sylvac.rack.line("y"))
    for _ in range(5):
        sylvac.rack.inject("y", InjectedGaugeFault.LATE, answers=1, seconds=0.02 * FAST)
        questions.clear()
        reading = asyncio.create_task(sylvac.gauges["y"].read())
        await until(lambda: bool(questions))
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading
        await sylvac.gauges["y"].check()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("fault", [InjectedGaugeFault.GARBLED_DIGIT, InjectedGaugeFault.GARBLED_BIT])
async def test_one_garbled_answer_never_gets_through(protocol, fault):
    async with cell([protocol] * 3, timeout_s=TIMEOUT_S) as made:
        await made.open()
        for _ in range(5):
            made.rack.inject("y", fault, answers=1)
            reading = await made.gauges["y"].read()
            assert reading.value_mm == pytest.approx(2.0, abs=0.05)


async def test_garbled_for_ever(sylvac):
    sylvac.rack.inject("y", InjectedGaugeFault.GARBLED_DIGIT)
    outcomes = []
    for _ in range(5):
        try:
            outcomes.append((await sylvac.gauges["y"].read()).value_mm)
        except GaugeUnsteady:
            outcomes.append(None)
    assert None in outcomes


@pytest.mark.parametrize("spoken", PROTOCOLS)
@pytest.mark.parametrize("driver", PROTOCOLS)
async def test_a_wrong_protocol_is_recognised(spoken, driver):
    if spoken == driver:
        return
    with served(spoken) as line:
        links = SharedSerialPorts(worst_latency_s=0.05)
        settings = GaugeSettings(name="y", axis="y", protocol=driver, port=line.url, timeout_s=0.1)
        with pytest.raises((WrongAnswer, GaugeSilent), match=r"gauge y: (answers|does not answer)"):
            await DRIVERS[driver](settings, links).open()
        await links.close()


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_unplugged_and_plugged_in_again(transport):
    async with cell(["sylvac"] * 3, transport) as made:
        await made.open()
        made.rack.inject("y", InjectedGaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match=r"gauge y: port .* was lost"):
            await made.gauges["y"].read()
        absent = "is absent" if transport == "pty" else "cannot be opened"
        for _ in range(2):
            with pytest.raises(DeviceError, match=f"gauge y: port .* {absent}"):
                await made.gauges["y"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.clear("y", InjectedGaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match="gauge y: is not open"):
            await made.gauges["y"].read()
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


async def test_unplugged_during_a_question():
    async with cell(["mux10"] * 3) as made:
        await made.gauges["x"].open()
        made.rack.inject("x", InjectedGaugeFault.SILENT)
        questions = questions_to(made.rack.line("x"))
        reading = asyncio.create_task(made.gauges["x"].read())
        await until(lambda: bool(questions))
        made.rack.inject("x", InjectedGaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match="was lost"):
            await reading


async def test_opening_again_finds_the_gauge_that_was_unplugged_unnoticed(sylvac):
    for _ in range(2):
        sylvac.rack.inject("y", InjectedGaugeFault.UNPLUGGED)
    for _ in range(2):
        sylvac.rack.clear("y", InjectedGaugeFault.UNPLUGGED)
    await sylvac.gauges["y"].open()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


async def test_a_socket_ended_unnoticed_is_opened_again():
    async with cell(["mux10"] * 3, "socket") as made:
        await made.open()
        made.rack.inject("x", InjectedGaugeFault.UNPLUGGED)
        made.rack.clear("x", InjectedGaugeFault.UNPLUGGED)
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(ZeroVoid, match="gauge y: lost its port meanwhile"):
            await made.gauges["y"].read()


async def test_a_truth_that_fails_is_as_loud_as_a_broken_cable(caplog):
    def broken():
        raise ArithmeticError("the truth has no such pose")

    with served("sylvac", broken) as line, caplog.at_level(logging.ERROR):
        link = SharedSerialPort(line.url, {})
        await link.open()
        with pytest.raises(DeviceError, match="was lost"):
            await ask(link)
        await link.close()
    assert "have failed" in caplog.text
