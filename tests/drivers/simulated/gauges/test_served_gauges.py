"""Drivers and simulated gauges over real pseudo-terminals and sockets, and every fault there is."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import serial

from drivers.gauges.cdi import CdiGauge
from drivers.gauges.errors import (
    GaugeAtEnd,
    GaugeSilent,
    GaugeUnsteady,
    WrongAnswer,
    WrongMode,
    WrongUnit,
    ZeroVoid,
)
from drivers.gauges.mux10 import Mux10Gauge
from drivers.gauges.serial_gauge import SerialGauge
from drivers.gauges.sylvac import SylvacGauge
from drivers.link import SerialLink, SerialLinks
from drivers.simulated.gauges.cell import GaugeRack, simulated_device
from drivers.simulated.gauges.faults import GaugeFault
from drivers.simulated.gauges.indicator import Indicator
from drivers.simulated.gauges.serving import serve_gauges
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, FileError

DRIVERS: dict[str, Callable[..., SerialGauge]] = {
    "sylvac": SylvacGauge,
    "mux10": Mux10Gauge,
    "cdi": CdiGauge,
}
PROTOCOLS = tuple(DRIVERS)
TRANSPORTS = ("pty", "socket")
FAST = 100.0
TIMEOUT_S = 0.3
WORST_LATENCY_S = 0.6
LONG_S = 10.0


class Cell:
    """Three gauges x, y, z that see balls at 1, 2 and 3 mm, and drivers for them."""

    def __init__(self, protocols, transport="pty", timeout_s=TIMEOUT_S, **simulation):
        self.balls = {"x": 1.0, "y": 2.0, "z": 3.0}
        settings = [
            GaugeSettings(name=name, axis=name, protocol=protocol, channel=number, timeout_s=timeout_s)
            for number, (name, protocol) in enumerate(zip("xyz", protocols, strict=True), start=1)
        ]
        plungers = {name: lambda name=name: self.balls[name] for name in "xyz"}
        simulated = SimulatedGauges(transport=transport, **simulation)
        self.rack = GaugeRack(settings, plungers, simulated, CellClock(FAST))
        self.links = SerialLinks(worst_latency_s=WORST_LATENCY_S)
        self.gauges = {each.name: DRIVERS[each.protocol](each, self.links) for each in self.rack.gauges}

    async def open(self):
        await asyncio.gather(*(gauge.open() for gauge in self.gauges.values()))

    async def values(self):
        readings = await asyncio.gather(*(gauge.read() for gauge in self.gauges.values()))
        return [reading.value_mm for reading in readings]


@contextlib.asynccontextmanager
async def cell(*args, **kwargs):
    made = Cell(*args, **kwargs)
    try:
        yield made
    finally:
        await made.links.close()
        made.rack.close()


@pytest.fixture
async def sylvac():
    """Three Sylvac gauges, opened."""
    async with cell(["sylvac"] * 3) as made:
        await made.open()
        yield made


def served(protocol, plunger=lambda: 1.0, transport="pty", factor=FAST, channels=(1,), **pace):
    indicators = {channel: Indicator(plunger) for channel in channels}
    return serve_gauges(simulated_device(protocol, indicators), transport, CellClock(factor), **pace)


async def ask(link, question=b"?\r"):
    return await link.exchange(question, b"\r", LONG_S)


# Round trips


@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("protocols", [PROTOCOLS, ("mux10",) * 3, ("sylvac", "mux10", "mux10")])
async def test_gauges_open_read_and_pass_the_check(protocols, transport):
    async with cell(protocols, transport) as made:
        await made.open()
        assert await made.values() == [1.0, 2.0, 3.0]
        made.balls["y"] = -4.5
        assert await made.values() == [1.0, -4.5, 3.0]
        for gauge in made.gauges.values():
            await gauge.check()


async def test_gauges_of_one_multiplexer_share_a_line_and_others_do_not():
    async with cell(["mux10", "sylvac", "mux10"]) as made:
        assert made.rack.line("x") is made.rack.line("z")
        assert made.rack.line("x") is not made.rack.line("y")
        assert [each.port for each in made.rack.gauges] == [made.rack.line(each).url for each in "xyz"]


def test_multiplexers_on_different_ports_are_different_lines():
    settings = [
        GaugeSettings(name=name, axis=name, protocol="mux10", channel=1, port=f"/dev/{name}")
        for name in "xyz"
    ]
    plungers = {name: lambda: 0.0 for name in "xyz"}
    with GaugeRack(settings, plungers, SimulatedGauges(), CellClock()) as rack:
        assert len({rack.line(name).url for name in "xyz"}) == 3


def test_an_unknown_protocol_is_refused_and_nothing_is_left_open():
    settings = [
        GaugeSettings(name="x", axis="x", protocol="sylvac"),
        GaugeSettings(name="y", axis="y", protocol="morse"),
    ]
    plungers = {"x": lambda: 0.0, "y": lambda: 0.0}
    with pytest.raises(FileError, match=r"no simulated gauge speaks protocol morse.*cdi, mux10, sylvac"):
        GaugeRack(settings, plungers, SimulatedGauges(), CellClock())


@pytest.mark.parametrize("asked", [False, True])
async def test_a_pseudo_terminal_opens_with_parity_again_and_again(asked):
    with served("sylvac") as line:
        for _ in range(5):
            link = SerialLink(line.url, baudrate=4800, bytesize=7, parity="E", stopbits=2, exclusive=True)
            await link.open()
            if asked:
                assert await ask(link) == b"+1.000\r"
            await link.close()


def test_a_foreign_client_may_open_it_with_parity_again():
    with served("sylvac") as line:
        for _ in range(5):
            port = serial.Serial(line.url, 4800, bytesize=7, parity="E", stopbits=2, timeout=LONG_S)
            port.write(b"?\r")
            assert port.read_until(b"\r") == b"+1.000\r"
            port.close()


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_questions_in_pieces_and_in_a_row_are_answered_in_order(transport):
    with served("sylvac", transport=transport) as line:
        port = serial.serial_for_url(line.url, timeout=LONG_S)
        for piece in (b"U", b"NI?", b"\r\n?\rBAT?\rI", b"D?\r"):
            port.write(piece)
        assert port.read(len(b"MM\r+1.000\rBAT1\rSY276\r")) == b"MM\r+1.000\rBAT1\rSY276\r"
        port.close()


async def test_a_second_client_of_a_socket_is_turned_away():
    with served("sylvac", transport="socket") as line:
        one, two = SerialLink(line.url), SerialLink(line.url)
        await one.open()
        assert await ask(one) == b"+1.000\r"
        await two.open()
        with pytest.raises(DeviceError, match="lost"):
            await ask(two)
        assert await ask(one) == b"+1.000\r"
        await one.close()
        await two.close()
        three = SerialLink(line.url)
        await three.open()
        assert await ask(three) == b"+1.000\r"
        await three.close()


# Pace


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
        link = SerialLink(line.url)
        await link.open()
        asked = clock.now()
        await ask(link, question)
        assert clock.now() - asked > 0.05 + wire_s - 0.001
        await link.close()


async def test_a_faster_clock_shortens_the_pace():
    with served("sylvac", factor=1000.0, latency_s=60.0) as line:
        link = SerialLink(line.url)
        await link.open()
        assert await ask(link) == b"+1.000\r"  # which waits for ten seconds on the wall at most
        await link.close()


async def test_closing_does_not_wait_for_answers_that_are_due():
    line = served("sylvac", factor=1.0, latency_s=3600.0)
    link = SerialLink(line.url)
    await link.open()
    waiting = asyncio.create_task(ask(link))
    await asyncio.sleep(0.05)
    line.close()
    line.close()
    with pytest.raises(DeviceError, match="lost"):
        await waiting
    await link.close()
    with pytest.raises(RuntimeError, match="is closed"):
        line.inject(GaugeFault.INCH)


# Faults of the line


async def test_silent(sylvac):
    sylvac.rack.inject("y", GaugeFault.SILENT)
    with pytest.raises(GaugeSilent, match="gauge y"):
        await sylvac.gauges["y"].read()
    sylvac.rack.clear("y", GaugeFault.SILENT)
    assert await sylvac.values() == [1.0, 2.0, 3.0]


async def test_a_late_answer_is_never_the_next_reading(sylvac):
    late_s = (TIMEOUT_S + 0.1) * FAST
    sylvac.rack.inject("y", GaugeFault.LATE, answers=1, seconds=late_s)
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["y"].read()
    sylvac.balls["y"] = 5.0
    assert (await sylvac.gauges["y"].read()).value_mm == 5.0
    await sylvac.gauges["y"].check()


async def test_cancelled_readings_leave_the_line_in_step(sylvac):
    for _ in range(5):
        reading = asyncio.create_task(sylvac.gauges["y"].read())
        await asyncio.sleep(0.001)
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading
        await sylvac.gauges["y"].check()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("fault", [GaugeFault.GARBLED_DIGIT, GaugeFault.GARBLED_BIT])
async def test_one_garbled_answer_never_gets_through(protocol, fault):
    async with cell([protocol] * 3, timeout_s=0.1) as made:
        await made.open()
        for _ in range(5):
            made.rack.inject("y", fault, answers=1)
            reading = await made.gauges["y"].read()
            assert reading.value_mm == pytest.approx(2.0, abs=0.05)


async def test_garbled_for_ever(sylvac):
    sylvac.rack.inject("y", GaugeFault.GARBLED_DIGIT)
    outcomes = []
    for _ in range(5):
        try:
            outcomes.append((await sylvac.gauges["y"].read()).value_mm)
        except GaugeUnsteady:
            outcomes.append(None)
    assert None in outcomes


# Faults of the instrument


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_inch(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("y", GaugeFault.INCH)
        for call in (made.gauges["y"].read, made.gauges["y"].check, made.gauges["y"].open):
            with pytest.raises(WrongUnit, match="gauge y: answers in inch"):
                await call()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.clear("y", GaugeFault.INCH)
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_hold(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("x", GaugeFault.HOLD)
        made.balls["x"] = 1.5
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(WrongMode, match="gauge x: is on hold"):
            await made.gauges["x"].check()
        made.rack.clear("x", GaugeFault.HOLD)
        await made.gauges["x"].check()
        assert (await made.gauges["x"].read()).value_mm == 1.5


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_reversed(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("z", GaugeFault.REVERSED)
        assert (await made.gauges["z"].read()).value_mm == -3.0
        with pytest.raises(ZeroVoid, match="gauge z: was set differently: reversed False -> True"):
            await made.gauges["z"].check()
        made.rack.clear("z", GaugeFault.REVERSED)
        await made.gauges["z"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0


async def test_battery_low(sylvac):
    sylvac.rack.inject("x", GaugeFault.BATTERY_LOW)
    with pytest.raises(WrongMode, match="gauge x: has a low battery"):
        await sylvac.gauges["x"].check()
    sylvac.rack.clear("x", GaugeFault.BATTERY_LOW)
    await sylvac.gauges["x"].check()


async def test_auto_off_and_on_again_voids_the_zero(sylvac):
    sylvac.rack.inject("x", GaugeFault.AUTO_OFF)
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["x"].read()
    sylvac.rack.clear("x", GaugeFault.AUTO_OFF)
    for call in (sylvac.gauges["x"].read, sylvac.gauges["x"].check):
        with pytest.raises(ZeroVoid, match=r"gauge x: was switched on again \(b'SY276\.1"):
            await call()
    await sylvac.gauges["x"].open()
    assert (await sylvac.gauges["x"].read()).value_mm == 0.0


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_plunger_at_its_end(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.balls["y"] = 6.3
        with pytest.raises(GaugeAtEnd, match="gauge y"):
            await made.gauges["y"].read()
        await made.gauges["y"].open()
        made.balls["y"] = 6.2
        assert (await made.gauges["y"].read()).value_mm == 6.2


async def test_a_data_button_is_not_mistaken_for_an_answer():
    async with cell(["mux10"] * 3) as made:
        await made.open()
        made.rack.line("x").send_unasked(b"01A+0009.999\r")
        assert await made.values() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("spoken", PROTOCOLS)
@pytest.mark.parametrize("driver", PROTOCOLS)
async def test_a_wrong_protocol_is_recognised(spoken, driver):
    if spoken == driver:
        return
    with served(spoken) as line:
        links = SerialLinks(worst_latency_s=0.05)
        settings = GaugeSettings(name="y", axis="y", protocol=driver, port=line.url, timeout_s=0.1)
        with pytest.raises((WrongAnswer, GaugeSilent), match=r"gauge y: (answers|does not answer)"):
            await DRIVERS[driver](settings, links).open()
        await links.close()


# The plug


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_unplugged_and_plugged_in_again(transport):
    async with cell(["sylvac"] * 3, transport) as made:
        await made.open()
        made.rack.inject("y", GaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match=r"gauge y: port .* was lost"):
            await made.gauges["y"].read()
        absent = "is absent" if transport == "pty" else "cannot be opened"
        for _ in range(2):
            with pytest.raises(DeviceError, match=f"gauge y: port .* {absent}"):
                await made.gauges["y"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.clear("y", GaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match="gauge y: is not open"):
            await made.gauges["y"].read()
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


async def test_unplugged_during_a_question():
    async with cell(["mux10"] * 3, latency_s=20.0) as made:
        await made.gauges["x"].open()
        reading = asyncio.create_task(made.gauges["x"].read())
        await asyncio.sleep(0.05)
        made.rack.inject("x", GaugeFault.UNPLUGGED)
        with pytest.raises(DeviceError, match="was lost"):
            await reading


async def test_opening_again_finds_the_gauge_that_was_unplugged_unnoticed(sylvac):
    for _ in range(2):
        sylvac.rack.inject("y", GaugeFault.UNPLUGGED)
    for _ in range(2):
        sylvac.rack.clear("y", GaugeFault.UNPLUGGED)
    await sylvac.gauges["y"].open()
    assert (await sylvac.gauges["y"].read()).value_mm == 2.0


async def test_a_socket_ended_unnoticed_is_opened_again():
    async with cell(["mux10"] * 3, "socket") as made:
        await made.open()
        made.rack.inject("x", GaugeFault.UNPLUGGED)
        made.rack.clear("x", GaugeFault.UNPLUGGED)
        await made.gauges["x"].open()
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(ZeroVoid, match="gauge y: lost its port in between"):
            await made.gauges["y"].read()


async def test_a_truth_that_fails_is_as_loud_as_a_broken_cable(caplog):
    def broken():
        raise ArithmeticError("the truth has no such pose")

    with served("sylvac", broken) as line, caplog.at_level(logging.ERROR):
        link = SerialLink(line.url)
        await link.open()
        with pytest.raises(DeviceError, match="was lost"):
            await ask(link)
        await link.close()
    assert "have died" in caplog.text


def test_nothing_stays_in_the_file_system():
    with served("sylvac", name="gauge / of the x axis") as line:
        path = Path(line.url)
        assert path.name == "gauge-of-the-x-axis"
        assert path.exists()
    assert not path.parent.exists()


def test_faults_of_one_instrument_need_no_channel_one():
    with served("mux10", channels=(2, 3)) as line:
        line.inject(GaugeFault.INCH)
        assert line.device.indicators[2].inch
        line.inject(GaugeFault.INCH, channel=3)
        assert line.device.indicators[3].inch
        with pytest.raises(KeyError):
            line.inject(GaugeFault.INCH, channel=1)
        line.inject(GaugeFault.SILENT, answers=1)


def test_answers_to_nobody_are_lost_as_on_a_cable():
    with served("sylvac") as line:
        for _ in range(1000):
            line.send_unasked(b"+1.000\r" * 10)
        port = serial.serial_for_url(line.url, timeout=LONG_S)
        time.sleep(0.01)
        port.reset_input_buffer()
        port.write(b"?\r")
        assert port.read(7) == b"+1.000\r"
        port.close()
