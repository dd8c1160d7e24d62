"""Drivers and simulated gauges understand each other over real lines, at the pace of a real one."""

import asyncio
import logging
from pathlib import Path

import pytest
import serial

from hexacell.clock import CellClock
from hexacell.errors import DeviceError
from tests.drivers.simulated.gauges.served.cell import (
    LONG_S,
    TRANSPORTS,
    ask,
    cell,
    linked,
    questions_to,
    served,
)
from tests.waiting import until


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_gauges_open_read_and_pass_the_check(transport):
    async with cell(("sylvac", "mux10", "mux10"), transport) as made:
        await made.open()
        assert await made.values() == [1.0, 2.0, 3.0]
        made.balls["y"] = -4.5
        assert await made.values() == [1.0, -4.5, 3.0]
        for gauge in made.gauges.values():
            await gauge.check()


@pytest.mark.parametrize("asked", [False, True])
async def test_a_pseudo_terminal_opens_with_parity_repeatedly(asked):
    settings = {"baudrate": 4800, "bytesize": 7, "parity": "E", "stopbits": 2, "exclusive": True}
    with served("sylvac") as line:
        for _ in range(5):
            async with linked(line, **settings) as link:
                if asked:
                    assert await ask(link) == b"+1.000\r"


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_questions_in_pieces_and_in_a_row_are_answered_in_order(transport):
    with served("sylvac", transport=transport) as line:
        port = serial.serial_for_url(line.url, timeout=LONG_S)
        for piece in (b"U", b"NI?", b"\r\n?\rBAT?\rI", b"D?\r"):
            port.write(piece)
        assert port.read(len(b"MM\r+1.000\rBAT1\rSY276\r")) == b"MM\r+1.000\rBAT1\rSY276\r"
        port.close()


async def test_a_second_client_of_a_socket_is_refused():
    with served("sylvac", transport="socket") as line:
        async with linked(line) as one:
            assert await ask(one) == b"+1.000\r"
            async with linked(line) as two:
                with pytest.raises(DeviceError, match="lost"):
                    await ask(two)
                assert await ask(one) == b"+1.000\r"
        async with linked(line) as three:
            assert await ask(three) == b"+1.000\r"


@pytest.mark.parametrize(
    ("protocol", "question", "baudrate", "wire_s"),
    [
        ("sylvac", b"?\r", None, 9 * 11 / 4800),
        ("mux10", b"1\r", None, 15 * 10 / 9600),
        ("cdi", b"R\r", None, 17 * 10 / 9600),
        ("cdi", b"R\r", 300, 17 * 10 / 300),
    ],
)
async def test_an_answer_takes_its_latency_and_its_time_on_the_wire(protocol, question, baudrate, wire_s):
    with served(protocol, factor=4.0, latency_s=0.05, baudrate=baudrate) as line:
        clock = CellClock(4.0)
        async with linked(line) as link:
            asked = clock.now()
            await ask(link, question)
            assert clock.now() - asked > 0.05 + wire_s - 0.001


async def test_closing_does_not_wait_for_answers_that_are_due():
    line = served("sylvac", factor=1.0, latency_s=3600.0)
    async with linked(line) as link:
        questions = questions_to(line)
        waiting = asyncio.create_task(ask(link))
        await until(lambda: bool(questions))
        line.close()
        line.close()
        with pytest.raises(DeviceError, match="lost"):
            await waiting
    with pytest.raises(RuntimeError, match="is closed"):
        line.set_unplugged(on=True)


def test_the_link_and_its_folder_are_removed():
    with served("sylvac", name="gauge / of the x axis") as line:
        path = Path(line.url)
        assert path.name == "gauge-of-the-x-axis"
        assert path.exists()
    assert not path.parent.exists()


async def test_an_error_of_the_simulation_breaks_the_line(caplog):
    def broken():
        raise ArithmeticError("the truth has no such pose")

    with served("sylvac", broken) as line, caplog.at_level(logging.ERROR):
        async with linked(line) as link:
            with pytest.raises(DeviceError, match="was lost"):
                await ask(link)
    assert "have failed" in caplog.text
