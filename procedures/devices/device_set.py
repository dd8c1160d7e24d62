"""The devices of one cell, together: open, read, kept fresh for screens, closed."""

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Generic, TypeVar

from drivers import interfaces
from drivers.stop_input import CombinedStopInput
from hexacell.cell.devices import GaugeAxis
from hexacell.errors import HexacellError, joined
from procedures.run.readings import Temperature

SAMPLE_PERIOD_S = 0.1
"""The shortest time between two changes that one subscriber is notified of, s."""

OTHERS_PERIOD_S = 1.0
"""Encoders and controller may be guarded meanwhile, which reads them more often."""

Result = TypeVar("Result")
Opened = interfaces.DeviceIdentity | tuple[interfaces.DeviceIdentity, ...] | None

_log = logging.getLogger(__name__)


class LiveValue(Generic[Result]):
    """The latest value of one device, or the problem that it had after that."""

    def __init__(self, live: "LiveValues") -> None:
        self.value: Result | None = None
        self.problem = ""
        self._live = live
        self.at_s = float("-inf")

    @property
    def age_s(self) -> float:
        """How long ago the device answered, s; infinite before the first answer."""
        return self._live.now() - self.at_s

    def fail(self, problem: str) -> None:
        """Say why the device cannot be asked."""
        self.problem = problem
        self._live.notify()

    async def of(self, read: Callable[[], Awaitable[Result]]) -> Result:
        """Ask for a value and keep it, or why there is none."""
        try:
            value = await read()
        except HexacellError as error:
            self.problem = str(error)
            raise
        else:
            self.value, self.problem, self.at_s = value, "", self._live.now()
            return value
        finally:
            self._live.notify()


class LiveValues:
    """The latest values of all devices, for screens; ``now`` gives seconds.

    They are the answers that the run needs anyway. No device is asked for a screen, so watching changes
    neither the traffic nor the timing of a run. A slow subscriber misses values and delays nothing.

    Attributes:
        encoders: the six joint variables.
        controller: whether it may move, and its error messages.
        stop_reason: why motion is forbidden; empty while it is not.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.encoders: LiveValue[interfaces.EncoderSample] = LiveValue(self)
        self.controller: LiveValue[interfaces.ControllerStatus] = LiveValue(self)
        self.stop_reason: LiveValue[str] = LiveValue(self)
        self._gauges: dict[str, LiveValue[interfaces.GaugeReading]] = {}
        self._subscribers: set[asyncio.Event] = set()

    def gauge(self, name: str) -> LiveValue[interfaces.GaugeReading]:
        """The reading of a gauge, mm in its own zero and direction."""
        return self._gauges.setdefault(name, LiveValue(self))

    async def changes(self, period_s: float = SAMPLE_PERIOD_S) -> AsyncGenerator[None]:
        """Gives way after each change, at most once every ``period_s`` seconds, until cancelled."""
        changed = asyncio.Event()
        self._subscribers.add(changed)
        try:
            while True:
                await changed.wait()
                changed.clear()
                yield
                await asyncio.sleep(period_s)
        finally:
            self._subscribers.discard(changed)

    def notify(self) -> None:
        """Wake the subscribers."""
        for changed in self._subscribers:
            changed.set()


@dataclass(frozen=True, slots=True)
class MountedGauge:
    """A gauge and the axis it is mounted on."""

    gauge: interfaces.Gauge
    axis: GaugeAxis


@dataclass(frozen=True, slots=True)
class Devices:
    """Three gauges, the encoders, the controller, and the stop input.

    What a run reads of them is also kept in ``live``.
    """

    gauges: tuple[MountedGauge, ...]
    encoders: interfaces.EncoderBank
    controller: interfaces.Controller
    stop_input: interfaces.StopInput = field(default_factory=CombinedStopInput)
    live: LiveValues = field(default_factory=LiveValues)

    async def open(self) -> tuple[interfaces.DeviceIdentity, ...]:
        """Connect to all at once; nothing moves. Raises ``HexacellError``, which names all that fail."""
        gauges: list[Awaitable[Opened]] = [mounted.gauge.open() for mounted in self.gauges]
        calls = [*gauges, self.encoders.open(), self.controller.open(), self.stop_input.open()]
        found = await gather_errors("devices do not answer as they must", calls)
        several = (one if isinstance(one, tuple) else (one,) for one in found)
        return tuple(identity for some in several for identity in some if identity is not None)

    async def read_gauge(self, gauge: interfaces.Gauge) -> interfaces.GaugeReading:
        """One reading of a gauge, which its driver repeats until it is sure."""
        return await self.live.gauge(gauge.name).of(gauge.read)

    async def read_gauge_once(self, gauge: interfaces.Gauge) -> interfaces.GaugeReading:
        """One reading of a gauge, without repetition."""
        return await self.live.gauge(gauge.name).of(gauge.read_once)

    async def read_encoders(self) -> interfaces.EncoderSample:
        """One sample of the encoders."""
        return await self.live.encoders.of(self.encoders.read)

    async def controller_status(self) -> interfaces.ControllerStatus:
        """The status of the controller."""
        return await self.live.controller.of(self.controller.status)

    async def stop_reason(self) -> str:
        """Why motion is forbidden; empty while it is not."""

        async def read() -> str:
            return await self.stop_input.active_reason() or ""

        return await self.live.stop_reason.of(read)

    async def close(self) -> None:
        """Let all of them go, whatever happens to one."""
        gauges: list[interfaces.Device[Any]] = [mounted.gauge for mounted in self.gauges]
        ports = [*gauges, self.encoders, self.controller, self.stop_input]
        await asyncio.gather(*(port.close() for port in ports), return_exceptions=True)


async def gather_errors(problem: str, calls: Sequence[Awaitable[Result]]) -> list[Result]:
    """Wait for all of the calls; one failure is raised as it is, several in one report."""
    results = await asyncio.gather(*calls, return_exceptions=True)
    errors = [result for result in results if isinstance(result, HexacellError)]
    others = [result for result in results if isinstance(result, BaseException)]
    if others and len(others) > len(errors):
        raise next(error for error in others if not isinstance(error, HexacellError))
    if errors:
        raise joined(problem, errors)
    return [result for result in results if not isinstance(result, BaseException)]


class Thermometers:
    """The cell's thermometers. One that fails gives a record without number, and one warning."""

    def __init__(self, thermometers: Sequence[interfaces.Thermometer] = ()) -> None:
        self._thermometers = tuple(thermometers)
        self._failing: set[str] = set()

    async def open(self) -> tuple[interfaces.DeviceIdentity, ...]:
        """Who answers; the others are warned of and may answer later."""
        found = await asyncio.gather(*(self._identity(one) for one in self._thermometers))
        return tuple(identity for identity in found if identity is not None)

    async def read(self) -> tuple[Temperature, ...]:
        """The temperatures now."""
        return tuple(await asyncio.gather(*(self._temperature(one) for one in self._thermometers)))

    async def close(self) -> None:
        """Let all of them go."""
        await asyncio.gather(*(one.close() for one in self._thermometers), return_exceptions=True)

    async def _identity(self, thermometer: interfaces.Thermometer) -> interfaces.DeviceIdentity | None:
        try:
            return await thermometer.open()
        except Exception as error:  # a third-party driver may raise anything
            self._warn(thermometer.name, error)
            return None

    async def _temperature(self, thermometer: interfaces.Thermometer) -> Temperature:
        try:
            reading = await thermometer.read()
        except Exception as error:
            self._warn(thermometer.name, error)
            return Temperature(name=thermometer.name, celsius=None, problem=_words(error))
        self._failing.discard(thermometer.name)
        return Temperature(name=thermometer.name, celsius=reading.celsius, raw=reading.raw)

    def _warn(self, name: str, error: Exception) -> None:
        if name not in self._failing:
            _log.warning("%s. Records are taken without this temperature", _words(error))
        self._failing.add(name)


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, HexacellError) else repr(error)


Source = tuple[LiveValue[Any], Callable[[], Awaitable[Any]], Callable[[], Awaitable[Any]]]
"""The live value of a device, what opens it, and what reads it once."""


def sources(devices: Devices) -> Iterator[Source]:
    """Every device, the gauges first. The reads move nothing and change no setting."""
    live = devices.live
    for one in devices.gauges:
        yield live.gauge(one.gauge.name), one.gauge.open, partial(devices.read_gauge_once, one.gauge)
    yield live.encoders, devices.encoders.open, devices.read_encoders
    yield live.controller, devices.controller.open, devices.controller_status
    yield live.stop_reason, devices.stop_input.open, devices.stop_reason


async def poll_for_screens(devices: Devices, period_s: float = SAMPLE_PERIOD_S) -> None:
    """Read each device whenever its live value has become older than ``period_s``, until cancelled."""
    others_s = max(period_s, OTHERS_PERIOD_S)
    periods = [period_s] * len(devices.gauges) + [others_s] * 3
    every = zip(sources(devices), periods, strict=True)
    await asyncio.gather(*(keep_reading(shown, read, each_s) for (shown, _, read), each_s in every))


async def keep_reading(shown: LiveValue[Any], read: Callable[[], Awaitable[Any]], period_s: float) -> None:
    """Read a device whenever its value has become older, until cancelled; one that fails is asked again."""
    while True:
        if shown.age_s >= period_s:
            with suppress(HexacellError):  # the live value says why
                await read()
        await asyncio.sleep(period_s)
