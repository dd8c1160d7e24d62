"""A million answers of each protocol over lines that damage one byte in a hundred: what gets through?

Three gauges are read as a run reads them, until their readings settle, each time at another place.
"""

from __future__ import annotations

import gc
import os
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
import pytest

from drivers.gauges import plausibility
from drivers.interfaces import EncoderSample, Gauge, GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import instrument_class
from drivers.simulated.gauges.instruments import Indicator
from drivers.wire_trace import WireTrace
from hexacell.cell.described_devices import RequestSettings
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.measuring import NoiseSettings, TimingSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, HexacellError, flatten_errors
from hexacell.plugins import Group, load
from hexacell.services.devices.device_setup import gauge_with_agreement
from procedures.devices.device_set import Devices, MountedGauge
from procedures.devices.settling import settle, trimmed_mean
from tests.benchmarks.figures import NEVER, at_least, at_most
from tests.benchmarks.line_in_process import Damage, InstrumentLine, have_lines
from tests.benchmarks.samples import sample

FRAMES = sample(__name__, "FRAMES")
HUNDREDTHS = sample(__name__, "HUNDREDTHS")
SHARE = 0.01
CHECKED_EVERY = 20
"""After so many records the settings are compared, as a run does at every reference."""

QUICKER = 1e6
TRAVEL_MM = 12.5
FARTHEST_MM = 5.0
NOISE = NoiseSettings()
TIMING = TimingSettings()

ONE_IN = 100_000
MEMORY_MIB = 8.0

ID_H = RequestSettings(
    ask="GA01\r\n", answer=r"GN01,([+-]\d{4}\.\d{4})", example="GN01,+0016.2345\r\n", at_end=r"GA01,ER\d"
)


def gauges(protocol: str) -> list[GaugeSettings]:
    """Three of one protocol; those of a multiplexer share its line."""
    return [
        GaugeSettings(
            name=axis,
            axis=axis,
            protocol=protocol,
            port="mux10" if protocol == "mux10" else axis,
            channel=place if protocol == "mux10" else 1,
            travel_mm=TRAVEL_MM,
            request=ID_H if protocol == "request" else None,
        )
        for place, axis in enumerate(("x", "y", "z"), 1)
    ]


class NoEncoders:
    """Encoders that stand still."""

    async def open(self) -> tuple:
        return ()

    async def read(self) -> EncoderSample:
        return EncoderSample((0,) * 6, (0.0,) * 6)

    async def close(self) -> None:
        pass


@dataclass
class Outcome:
    """What came of all records."""

    records: int = 0
    wrong_records: int = 0
    readings: int = 0
    wrong_readings: int = 0
    shown_by_another: int = 0
    refused: Counter = field(default_factory=Counter)
    foreign: list[Exception] = field(default_factory=list)


class Watched:
    """A gauge whose readings are compared with the truth.

    A reading that is farther from it than two readings may differ is one that the other reading shows,
    unless both answers were damaged.
    """

    def __init__(
        self,
        gauge: Gauge,
        truth: Callable[[], float],
        agreement_mm: float,
        damage: Damage,
        outcome: Outcome,
    ) -> None:
        self._gauge, self._truth, self._damage, self._outcome = gauge, truth, damage, outcome
        self._agreement_mm = agreement_mm
        self.name = gauge.name
        self.open, self.close, self.check = gauge.open, gauge.close, gauge.check
        self.read_once = gauge.read_once

    async def read(self) -> GaugeReading:
        damaged = self._damage.damaged
        reading = await self._gauge.read()
        error = abs(reading.value_mm - self._truth())
        self._outcome.readings += 1
        if error > self._agreement_mm + 1e-9:
            self._outcome.wrong_readings += 1
            self._outcome.shown_by_another += self._damage.damaged - damaged < 2
        return reading


class Cell:
    """Three gauges on damaged lines."""

    def __init__(self, protocol: str, monkeypatch: pytest.MonkeyPatch, random: Random) -> None:
        settings = [gauge_with_agreement(one, NOISE) for one in gauges(protocol)]
        self.damage = Damage(0.0, random)
        self.outcome = Outcome()
        self.truth = [0.0, 0.0, 0.0]
        self.indicators = [Indicator(self._plunger(place), TRAVEL_MM) for place in range(3)]
        by_port: dict[str, dict[int, Indicator]] = {}
        for one, indicator in zip(settings, self.indicators, strict=True):
            by_port.setdefault(str(one.port), {})[one.channel] = indicator
        described = (ID_H,) if protocol == "request" else ()
        have_lines(
            monkeypatch,
            {
                url: InstrumentLine(instrument_class(protocol)(some, *described), self.damage)
                for url, some in by_port.items()
            },
        )
        self.ports = SharedSerialPorts(trace=WireTrace())
        self.gauges = [
            Watched(
                load(Group.GAUGES, protocol)(one, self.ports),
                self._plunger(place),
                one.agreement_mm or 0.0,
                self.damage,
                self.outcome,
            )
            for place, one in enumerate(settings)
        ]
        mounted = tuple(
            MountedGauge(gauge, one.mounting) for gauge, one in zip(self.gauges, settings, strict=True)
        )
        self.devices = Devices(mounted, NoEncoders(), None)  # type: ignore[arg-type]
        self._clock = CellClock(QUICKER)
        self._random = random

    def _plunger(self, place: int) -> Callable[[], float]:
        return lambda: self.truth[place]

    async def open(self) -> None:
        """On lines without damage: what is opened on a bad line is another matter."""
        share, self.damage.share = self.damage.share, 0.0
        for gauge in self.gauges:
            await gauge.close()
            await gauge.open()
        self.damage.share = share

    async def record(self) -> None:
        """One record of three gauges at a new place."""
        self.truth[:] = [round(self._random.uniform(-FARTHEST_MM, FARTHEST_MM), 3) for _ in range(3)]
        outcome = self.outcome
        try:
            settled = await settle(self.devices, TIMING, self._clock)
            outcome.records += 3
            errors = np.abs(trimmed_mean(settled.gauges) - self.truth)
            outcome.wrong_records += int(np.sum(errors > NOISE.gauge_mm))
            if outcome.records // 3 % CHECKED_EVERY == 0:
                for gauge in self.gauges:
                    await gauge.check()
        except HexacellError as error:
            for one in flatten_errors(error):
                outcome.refused[type(one).__name__] += 1
                assert isinstance(one, DeviceError)
            await self.open()
        except Exception as error:
            outcome.foreign.append(error)
            await self.open()


def resident_mib() -> float:
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@asynccontextmanager
async def opened(protocol: str, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Cell]:
    cell = Cell(protocol, monkeypatch, Random(protocol))
    await cell.open()
    cell.damage.share = SHARE
    try:
        yield cell
    finally:
        await cell.devices.gauges[0].gauge.close()
        await cell.ports.close()


PROTOCOLS = (
    "sylvac",
    "mux10",
    "cdi",
    "request",
    "digimatic-usb",
    "heidenhain-nd",
    "keyence-dl-rs1a",
    "mitutoyo-id-h",
)
"""Whose gauges are asked; what streams or has checksums is left out."""


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_no_damage_becomes_a_record(protocol: str, figure, monkeypatch) -> None:
    async with opened(protocol, monkeypatch) as cell:
        outcome, memory = cell.outcome, [0.0]
        while cell.damage.answers < FRAMES:
            await cell.record()
            if memory == [0.0] and cell.damage.answers >= FRAMES / 2:
                memory[0] = resident_mib()
        grown = resident_mib() - memory[0]
        damage = cell.damage
    figure(f"{protocol}: answers", damage.answers)
    figure("  damaged", damage.damaged)
    figure("  records", outcome.records)
    figure("  wrong records", outcome.wrong_records, "", at_most(outcome.records / ONE_IN))
    figure("  readings off by more than two may differ", outcome.wrong_readings)
    figure("    of them with a true one", outcome.shown_by_another, "", NEVER)
    refused = ", ".join(f"{n} {name}" for name, n in outcome.refused.items())
    figure("  refused", refused or "none")
    figure("  exceptions of other kinds", len(outcome.foreign), "", NEVER)
    figure("  memory grown in the second half", grown, "MiB", at_most(MEMORY_MIB))


class HundredthsDamage(Damage):
    """Four hundredths more or less: the worst that two readings that may differ by 0.05 mm do not show."""

    def of(self, answer: bytes) -> bytes:
        self.answers += 1
        if b"." not in answer or self.random.random() >= self.share:
            return answer
        place = answer.index(b".") + 2
        changed = bytes((answer[place] ^ FOUR,))
        if not changed.isdigit():
            return answer
        self.damaged += 1
        return answer[:place] + changed + answer[place + 1 :]


FOUR = 4
USUAL_SHARE = plausibility.ALIKE_SHARE
HUNDREDTHS_SHARE = 0.02


async def wrong_of(alike_share: float, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Records that such damage made wrong, and all of them."""
    monkeypatch.setattr(plausibility, "ALIKE_SHARE", alike_share)
    monkeypatch.setattr("tests.benchmarks.test_damaged_lines.Damage", HundredthsDamage)
    cell = Cell("mux10", monkeypatch, Random("hundredths"))
    await cell.open()
    cell.damage.share = HUNDREDTHS_SHARE
    try:
        while cell.damage.answers < HUNDREDTHS:
            await cell.record()
    finally:
        await cell.devices.gauges[0].gauge.close()
        await cell.ports.close()
    return cell.outcome.wrong_records, cell.outcome.records


async def test_the_same_bit_of_two_readings_of_five_is_no_record(figure, monkeypatch) -> None:
    """The cause of the only wrong record of a million: two such readings outlast the trimmed mean."""
    two, of_two = await wrong_of(1.0, monkeypatch)
    three, of_three = await wrong_of(USUAL_SHARE, monkeypatch)
    figure("hundredths damaged, any two readings that agree: wrong", two, f"of {of_two}", at_least(1))
    figure("  the middle one of three", three, f"of {of_three}", at_most(0.1 * two * of_three / of_two))
