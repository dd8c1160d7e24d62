"""Rounds of the encoders, a SYNC and six positions, beside what a CAN bus of that bit rate allows.

In the simulated time of a bus paced by bits; beside it slcan on a pseudo-terminal, in real time, with the
machine as it is.

The simulated time passes by the processor time of all threads, as if they worked one after the other. On
one processor they do; on two, what they do at the same time, and what it costs to wake the other processor,
would count as well.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.slcan import SlcanServer
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.clock import CellClock
from tests.benchmarks.figures import NEVER, at_least
from tests.benchmarks.paced_can_bus import COUNTS, ROUND_BITS, PacedBus
from tests.benchmarks.samples import sample

ROUNDS = sample(__name__, "ROUNDS")
WARM_UP = 200
LEAST_SHARE = 0.9
HEARTBEAT_MS = 500


@pytest.mark.usefixtures("on_one_processor")
@pytest.mark.parametrize("bitrate", [125_000, 500_000])
async def test_rounds_come_as_often_as_the_bus_allows(bitrate: int, figure, monkeypatch) -> None:
    """One after the other by the thread of the bus, and each asked for by a coroutine."""
    allowed = bitrate / ROUND_BITS
    bus = PacedBus(bitrate, HEARTBEAT_MS / 1000)
    with monkeypatch.context() as patched:
        bus.install(patched)
        bank = Cia406Bank(LinearEncoderSettings(bus={"interface": "paced"}, heartbeat_ms=HEARTBEAT_MS))
        await bank.open()
        assert bank._worker is not None
        by_thread = await bank._worker.run(partial(_rounds_by_thread, bank, bus))
        by_coroutine = await _rounds_by_coroutine(bank, bus)
        await bank.close()
    for words, taken in (("one after the other", by_thread), ("each asked for", by_coroutine)):
        rate = ROUNDS / taken.seconds
        figure(
            f"{bitrate // 1000} kbit/s, {words}: of what it allows",
            rate / allowed,
            "",
            at_least(LEAST_SHARE),
        )
        figure(f"  {words}: rounds a second", rate)
        figure(f"  {words}: bus busy with anything", taken.busy_s / taken.seconds)
        figure(f"  {words}: incomplete rounds", taken.syncs - ROUNDS, f"of {ROUNDS}", NEVER)


@dataclass(frozen=True)
class Taken:
    """What happened on a bus: in how many seconds, how long it was busy, how many SYNCs there were."""

    seconds: float
    busy_s: float
    syncs: int

    @classmethod
    def until_now(cls, bus: PacedBus) -> Taken:
        return cls(bus.time.monotonic(), bus.busy_s, bus.syncs)

    def __sub__(self, before: Taken) -> Taken:
        return Taken(self.seconds - before.seconds, self.busy_s - before.busy_s, self.syncs - before.syncs)


def _rounds_by_thread(bank: Cia406Bank, bus: PacedBus) -> Taken:
    assert bank._session is not None
    for _ in range(WARM_UP):
        bank._session.read()
    before = Taken.until_now(bus)
    for _ in range(ROUNDS):
        assert bank._session.read().counts == COUNTS
    return Taken.until_now(bus) - before


async def _rounds_by_coroutine(bank: Cia406Bank, bus: PacedBus) -> Taken:
    before = Taken.until_now(bus)
    for _ in range(ROUNDS):
        assert (await bank.read()).counts == COUNTS
    return Taken.until_now(bus) - before


async def test_rounds_over_slcan(figure) -> None:
    settings = LinearEncoderSettings()
    with (
        SimulatedEncoderBank(settings, lambda: [0.0] * 6, CellClock()) as simulated,
        SlcanServer(simulated.channel, PtyLine("slcan")) as adapter,
    ):
        bank = Cia406Bank(settings.model_copy(update={"bus": adapter.bus_settings}))
        await bank.open()
        begun = time.monotonic()
        for _ in range(WARM_UP):
            await bank.read()
        rate = WARM_UP / (time.monotonic() - begun)
        await bank.close()
    figure("slcan on a pseudo-terminal, simulated encoders: rounds a second", rate, "", at_least(10))
