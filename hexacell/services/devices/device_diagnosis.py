"""One gauge, or the encoders, watched for some seconds while nothing is commanded."""

import time
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from drivers.errors import GaugeAtEnd, GaugeSilent, InvalidSampleError, WrongAnswer
from drivers.interfaces import DeviceIdentity, EncoderBank, Gauge
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.errors import HexacellError, UsageError
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.devices.device_setup import device_addresses, devices_of
from procedures.run.cancellation import shielded

ENCODERS = "encoders"
FEWEST_FOR_SCATTER = 3


class Failure(StrEnum):
    """What came instead of a reading, in words."""

    DAMAGED = "damaged or foreign"
    MISSING = "missing"
    AT_END = "at an end of the travel"
    INVALID = "invalid"


FAILURES: Mapping[type[HexacellError], Failure] = {
    WrongAnswer: Failure.DAMAGED,
    GaugeSilent: Failure.MISSING,
    GaugeAtEnd: Failure.AT_END,
    InvalidSampleError: Failure.INVALID,
}

Read = Callable[[], Awaitable[tuple[float, ...]]]
"""One reading of all numbers of a device."""


@dataclass(frozen=True)
class SeriesFigures:
    """What one number did: its range and scatter, in ``unit``, and how many values were distinct.

    ``scatter`` is one standard deviation about a straight line; None with fewer than three readings.
    """

    name: str
    unit: str
    lowest: float
    highest: float
    scatter: float | None
    distinct: int


@dataclass(frozen=True)
class FailureFigures:
    """How often something came instead of a reading, and what was said of it the last time."""

    kind: Failure
    count: int
    latest: str


@dataclass(frozen=True)
class DeviceDiagnosis:
    """What was seen of a device.

    Attributes:
        problem: why it was not watched to the end, or what its settings are wrong by; empty if neither.
    """

    device: str = ""
    identities: tuple[DeviceIdentity, ...] = ()
    seconds: float = 0.0
    readings: int = 0
    series: tuple[SeriesFigures, ...] = ()
    failures: tuple[FailureFigures, ...] = ()
    problem: str = ""
    stated_noise: float = 0.0

    @property
    def is_usable(self) -> bool:
        """Whether it could be read throughout."""
        return bool(self.readings) and not self.problem


async def diagnose(cell: Cell, device: str, seconds: float) -> DeviceDiagnosis:
    """Watch a gauge, by its name, or ``encoders``.

    Raises ``UsageError`` for an unknown device, ``CellBusy``, or ``HexacellError`` if it cannot be opened.
    """
    known = [gauge.name for gauge in cell.settings.gauges] + [ENCODERS]
    if device not in known:
        raise UsageError(f"the cell has no device '{device}'", action=f"Name one of {', '.join(known)}")
    with cell_lock(*cell.config_paths), device_addresses(cell, other_processes=False) as settings:
        trace = WireTrace()
        links = SharedSerialPorts(trace=trace)
        try:  # of all drivers, only the one that is watched is opened
            devices = devices_of(settings, links, trace)
            if device == ENCODERS:
                return await _watch_encoders(devices.encoders, settings, seconds)
            [mounted] = [one for one in devices.gauges if one.gauge.name == device]
            return await _watch_gauge(mounted.gauge, settings.noise.gauge_at(mounted.axis.index), seconds)
        finally:
            await shielded(links.close())


async def _watch_gauge(gauge: Gauge, stated_mm: float, seconds: float) -> DeviceDiagnosis:
    async def read() -> tuple[float, ...]:
        return ((await gauge.read_once()).value_mm,)

    try:
        identity = await gauge.open()
        seen = await _watched(read, seconds, [f"gauge {gauge.name}"], "mm")
        if not seen.problem:
            try:
                await gauge.check()
            except HexacellError as error:
                seen = replace(seen, problem=str(error))
    finally:
        await gauge.close()
    return replace(seen, device=gauge.name, identities=(identity,), stated_noise=stated_mm)


async def _watch_encoders(encoders: EncoderBank, settings: CellSettings, seconds: float) -> DeviceDiagnosis:
    async def read() -> tuple[float, ...]:
        return (await encoders.read()).positions

    try:
        identities = await encoders.open()
        names = [f"encoder {leg}" for leg in range(1, settings.mechanism.joint_count + 1)]
        seen = await _watched(read, seconds, names, str(settings.encoders.unit))
    finally:
        await encoders.close()
    return replace(seen, device=ENCODERS, identities=identities, stated_noise=settings.noise.encoder)


async def _watched(read: Read, seconds: float, names: Sequence[str], unit: str) -> DeviceDiagnosis:
    """Read as fast as the device answers, at least once; ``names`` are those of its numbers.

    Failures are kept by kind, as each damaged answer is another one.
    """
    begun, passed_s, problem = time.monotonic(), 0.0, ""
    values: list[tuple[float, ...]] = []
    failures: defaultdict[Failure, list[str]] = defaultdict(list)
    while not problem and (not passed_s or passed_s < seconds):
        try:
            values.append(await read())
        except tuple(FAILURES) as error:
            kind = next(kind for base, kind in FAILURES.items() if isinstance(error, base))
            failures[kind].append(error.problem)
        except HexacellError as error:
            problem = str(error)
        passed_s = time.monotonic() - begun
    series = []
    for name, column in zip(names, np.array(values).T if values else (), strict=False):
        lowest, highest, distinct = float(column.min()), float(column.max()), len(set(column.tolist()))
        series.append(SeriesFigures(name, unit, lowest, highest, _scatter(column), distinct))
    return DeviceDiagnosis(
        seconds=passed_s,
        readings=len(values),
        series=tuple(series),
        failures=tuple(FailureFigures(kind, len(said), said[-1]) for kind, said in failures.items()),
        problem=problem,
    )


def _scatter(values: np.ndarray) -> float | None:
    """The standard deviation about a straight line: a drift is no noise."""
    count = len(values)
    if count < FEWEST_FOR_SCATTER:
        return None
    times = np.arange(count)
    line = np.polynomial.Polynomial.fit(times, values, 1)
    return float(np.sqrt(np.sum((values - line(times)) ** 2) / (count - 2)))
