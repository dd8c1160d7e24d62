"""How often three gauges are polled at once, beside what their latency and baud rates allow.

An answer takes at least the latency of the instrument, and the time of request and answer on the wire. What
the driver adds is what it waits beyond that, in the simulated time of lines inside this process, and its
processor time: that of the line's thread, and that of the event loop for all three gauges. So other work on
the machine counts little. What comes of it on pseudo-terminals in real time, with the machine as it is, is
said beside it.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

import pytest

from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import SimulatedGaugeBank, instrument_class
from drivers.simulated.gauges.instruments import Indicator, Instrument
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import SimulatedGauges
from hexacell.clock import CellClock
from hexacell.plugins import Group, load
from tests.benchmarks.figures import at_least
from tests.benchmarks.line_in_process import Damage, InstrumentLine, LineTime, have_lines
from tests.benchmarks.samples import sample

POLLS = sample(__name__, "POLLS")
LEAST_SHARE = 0.95
SHOWN_MM = 1.234
AXES = ("x", "y", "z")
FRAMES_A_CALL = {"read_once": 1, "read": 2}


@dataclass(frozen=True)
class Cell:
    """Three gauges: their protocols, whether they share one line, and how quick their answers are."""

    protocols: tuple[str, str, str]
    latency_s: float = 0.02
    baudrate: int | None = None
    share_a_line: bool = False

    @property
    def gauges(self) -> list[GaugeSettings]:
        places = (1, 2, 3) if self.share_a_line else (1, 1, 1)
        return [
            GaugeSettings(
                name=axis,
                axis=axis,
                protocol=protocol,
                port="shared" if self.share_a_line else axis,
                channel=place,
            )
            for axis, protocol, place in zip(AXES, self.protocols, places, strict=True)
        ]

    def byte_s(self, instrument: Instrument) -> float:
        return instrument.bits_a_byte / (self.baudrate or instrument.baudrate)

    def least_s(self, instrument: Instrument, gauge: Gauge, call: str) -> float:
        """How long the requests and answers of one call take."""
        request: bytes = gauge.value_request  # type: ignore[attr-defined]
        size = len(request) + len(instrument.answer(request.rstrip(b"\r")).rstrip(b"\n"))
        sharing = 3 if self.share_a_line else 1
        return sharing * FRAMES_A_CALL[call] * (self.latency_s + size * self.byte_s(instrument))


CELLS = {
    "a Sylvac, a MUX-10, a CDI": Cell(("sylvac", "mux10", "cdi")),
    "three Sylvac": Cell(("sylvac",) * 3),
    "three at one MUX-10": Cell(("mux10",) * 3, share_a_line=True),
    "three CDI of 5 ms and 115,200 baud": Cell(("cdi",) * 3, latency_s=0.005, baudrate=115_200),
}


@pytest.mark.usefixtures("on_one_processor")
@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("call", FRAMES_A_CALL)
async def test_three_gauges_are_polled_as_often_as_their_lines_allow(
    name: str, call: str, figure, monkeypatch
) -> None:
    cell = CELLS[name]
    on_terminals = await _on_terminals(cell, call)
    share, processor_s = await _in_process(cell, call, monkeypatch)
    figure(f"{name}, {call}: of what the lines allow", share, "", at_least(LEAST_SHARE))
    figure("  processor time of a call", 1e6 * processor_s, "us")
    figure("  on pseudo-terminals, with the machine as it is now", on_terminals)


async def _in_process(cell: Cell, call: str, monkeypatch) -> tuple[float, float]:
    """The share of the rate that the slowest line allows, and the processor time of one call, s."""
    by_port: dict[str, dict[int, Indicator]] = {}
    for one in cell.gauges:
        by_port.setdefault(str(one.port), {})[one.channel] = Indicator(lambda: SHOWN_MM)
    lines = {}
    for one in cell.gauges:
        instrument = instrument_class(one.protocol)(by_port[str(one.port)])
        lines[str(one.port)] = InstrumentLine(
            instrument, Damage(), latency_s=cell.latency_s, byte_s=cell.byte_s(instrument)
        )
    with monkeypatch.context() as patched:
        have_lines(patched, lines, LineTime(with_processor_time=True))
        gauges, ports = await _opened(cell.gauges)
        await asyncio.gather(*(_poll(gauge, call) for gauge in gauges))  # warms up
        before_s = {url: line.elapsed_s for url, line in lines.items()}
        all_begun, loop_begun = time.process_time(), time.thread_time()
        await asyncio.gather(*(_poll(gauge, call) for gauge in gauges))
        loop_s, all_s = time.thread_time() - loop_begun, time.process_time() - all_begun
        await ports.close()
    shares = []
    for one, gauge in zip(cell.gauges, gauges, strict=True):
        line = lines[str(one.port)]
        taken_s = (line.elapsed_s - before_s[str(one.port)]) / POLLS
        shares.append(cell.least_s(line.instrument, gauge, call) / (taken_s + loop_s / POLLS))
    return min(shares), all_s / POLLS / len(gauges)


async def _on_terminals(cell: Cell, call: str) -> float:
    simulated = SimulatedGauges(latency_s=cell.latency_s, baudrate=cell.baudrate)
    plungers = dict.fromkeys(AXES, lambda: SHOWN_MM)
    with SimulatedGaugeBank(cell.gauges, plungers, simulated, CellClock()) as bank:
        gauges, ports = await _opened(bank.gauges)
        taken = await asyncio.gather(*(_poll(gauge, call) for gauge in gauges))
        await ports.close()
        instruments = [bank.line(gauge.name).instrument for gauge in gauges]
    least = [cell.least_s(one, gauge, call) for one, gauge in zip(instruments, gauges, strict=True)]
    return min(one / each for one, each in zip(least, taken, strict=True))


async def _opened(settings) -> tuple[list[Gauge], SharedSerialPorts]:
    ports = SharedSerialPorts()
    gauges = [load(Group.GAUGES, one.protocol)(one, ports) for one in settings]
    for gauge in gauges:
        await gauge.open()
    return gauges, ports


async def _poll(gauge: Gauge, call: str) -> float:
    """Seconds a poll."""
    begun = time.monotonic()
    for _ in range(POLLS):
        await getattr(gauge, call)()
    return (time.monotonic() - begun) / POLLS
