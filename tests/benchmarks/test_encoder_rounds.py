"""Rounds of the encoders, a SYNC and six positions, beside what a CAN bus of that bit rate allows.

In the simulated time of a bus paced by bits, which passes by the processor time of all threads, as if they
worked one after the other. On one processor they do; on two, what they do at the same time, and what it
costs to wake the other processor, would count as well.
"""

import os
from collections.abc import Iterator

import pytest

from drivers.encoders.cia406 import Cia406Bank
from hexacell.cell.devices import LinearEncoderSettings
from tests.benchmarks.figures import NEVER, at_least
from tests.benchmarks.paced_can_bus import COUNTS, ROUND_BITS, PacedBus
from tests.benchmarks.samples import sample

ROUNDS = sample(__name__, "ROUNDS")
WARM_UP = 200
LEAST_SHARE = 0.9
HEARTBEAT_MS = 500


@pytest.fixture
def on_one_processor() -> Iterator[None]:
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(usual)})
    yield
    os.sched_setaffinity(0, usual)


@pytest.mark.usefixtures("on_one_processor")
@pytest.mark.parametrize("bitrate", [125_000, 500_000])
async def test_rounds_come_as_often_as_the_bus_allows(bitrate: int, figure, monkeypatch) -> None:
    bus = PacedBus(bitrate, HEARTBEAT_MS / 1000)
    with monkeypatch.context() as patched:
        bus.install(patched)
        bank = Cia406Bank(LinearEncoderSettings(bus={"interface": "paced"}, heartbeat_ms=HEARTBEAT_MS))
        await bank.open()
        for _ in range(WARM_UP):
            await bank.read()
        begun_s, busy_s, syncs = bus.time.monotonic(), bus.busy_s, bus.syncs
        for _ in range(ROUNDS):
            assert (await bank.read()).counts == COUNTS
        seconds = bus.time.monotonic() - begun_s
        busy_s, syncs = bus.busy_s - busy_s, bus.syncs - syncs
        await bank.close()
    rate, allowed = ROUNDS / seconds, bitrate / ROUND_BITS
    figure(
        f"{bitrate // 1000} kbit/s: of the rounds that it allows", rate / allowed, "", at_least(LEAST_SHARE)
    )
    figure("  rounds a second", rate)
    figure("  bus busy with anything", busy_s / seconds)
    figure("  incomplete rounds", syncs - ROUNDS, f"of {ROUNDS}", NEVER)
