"""Faults of the line: answers that are late, garbled or missing, and the plug."""

import asyncio
import contextlib
import logging
from functools import partial
from random import Random

import pytest

from drivers.errors import GaugeSilent, GaugeUnsteady, WrongAnswer, ZeroVoid
from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError
from tests.drivers.simulated.gauges.garbling import flip_bit, flip_digit
from tests.drivers.simulated.gauges.served.cell import (
    DRIVERS,
    FAST,
    PROTOCOLS,
    TIMEOUT_S,
    TRANSPORTS,
    ask,
    cell,
    change_answers,
    questions_to,
    served,
)
from tests.waiting import until


async def test_a_silent_gauge_is_reported_and_read_again_afterwards(sylvac):
    sylvac.rack.line("y").set_silent(on=True)
    with pytest.raises(GaugeSilent, match="gauge y"):
        await sylvac.gauges["y"].read()
    sylvac.rack.line("y").set_silent(on=False)
    assert await sylvac.values() == [1.0, 2.0, 3.0]


async def test_a_late_answer_is_never_the_next_reading(sylvac):
    line = sylvac.rack.line("y")
    usual_s, line._latency_s = line._latency_s, (TIMEOUT_S + 0.1) * FAST
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["y"].read()
    line._latency_s = usual_s
    sylvac.balls["y"] = 5.0
    assert (await sylvac.gauges["y"].read()).value_mm == 5.0
    await sylvac.gauges["y"].check()


async def test_after_cancelled_readings_answers_belong_to_their_requests(sylvac):
    line = sylvac.rack.line("y")
    line._latency_s = 0.02 * FAST
    questions = questions_to(line)
    for _ in range(5):
        questions.clear()
        reading = asyncio.create_task(sylvac.gauges["y"].read())
        await until(lambda: bool(questions))
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading
        await sylvac.gauges["y"].check()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("garbled", [flip_digit, flip_bit])
async def test_one_garbled_answer_is_never_accepted(protocol, garbled):
    async with cell([protocol] * 3, timeout_s=TIMEOUT_S) as made:
        await made.open()
        random = Random(0)
        for _ in range(5):
            change_answers(made.rack.line("y"), partial(garbled, random=random), count=1)
            reading = await made.gauges["y"].read()
            assert reading.value_mm == pytest.approx(2.0, abs=0.05)


async def test_readings_garbled_every_time_are_not_accepted(sylvac):
    change_answers(sylvac.rack.line("y"), partial(flip_digit, random=Random(0)))
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
        made.rack.line("y").set_unplugged(on=True)
        with pytest.raises(DeviceError, match=r"gauge y: port .* was lost"):
            await made.gauges["y"].read()
        absent = "is absent" if transport == "pty" else "cannot be opened"
        for _ in range(2):
            with pytest.raises(DeviceError, match=f"gauge y: port .* {absent}"):
                await made.gauges["y"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.line("y").set_unplugged(on=False)
        with pytest.raises(DeviceError, match="gauge y: is not open"):
            await made.gauges["y"].read()
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


async def test_unplugged_during_a_question():
    async with cell(["mux10"] * 3) as made:
        await made.gauges["x"].open()
        made.rack.line("x").set_silent(on=True)
        questions = questions_to(made.rack.line("x"))
        reading = asyncio.create_task(made.gauges["x"].read())
        await until(lambda: bool(questions))
        made.rack.line("x").set_unplugged(on=True)
        with pytest.raises(DeviceError, match="was lost"):
            await reading


async def test_opening_finds_a_gauge_that_was_unplugged_and_plugged_in_again(sylvac):
    for _ in range(2):
        sylvac.rack.line("y").set_unplugged(on=True)
    for _ in range(2):
        sylvac.rack.line("y").set_unplugged(on=False)
    await sylvac.gauges["y"].open()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


async def test_a_socket_that_was_cut_is_opened_again():
    async with cell(["mux10"] * 3, "socket") as made:
        await made.open()
        made.rack.line("x").set_unplugged(on=True)
        made.rack.line("x").set_unplugged(on=False)
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(ZeroVoid, match="gauge y: lost its port meanwhile"):
            await made.gauges["y"].read()


async def test_an_error_of_the_simulation_breaks_the_line(caplog):
    def broken():
        raise ArithmeticError("the truth has no such pose")

    with served("sylvac", broken) as line, caplog.at_level(logging.ERROR):
        link = SharedSerialPort(line.url, {})
        await link.open()
        with pytest.raises(DeviceError, match="was lost"):
            await ask(link)
        await link.close()
    assert "have failed" in caplog.text
