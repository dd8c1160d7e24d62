"""What the devices of a running calibration show now, for screens.

Every reading that the run takes of a device passes through here: those of the guards, several a second
while the robot moves, and those of records. No device is asked for a screen's sake, so watching changes
neither the traffic nor the timing of a run. Only the latest value of each device is kept; a slow
subscriber misses values and delays nothing.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from drivers.interfaces import (
    Controller,
    ControllerStatus,
    DeviceIdentity,
    EncoderBank,
    EncoderSample,
    Gauge,
    GaugeReading,
    StopInput,
)
from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose
from procedures.devices.device_set import Devices

T = TypeVar("T")

SAMPLE_PERIOD_S = 0.1
"""The shortest time between two snapshots for one subscriber, s."""


@dataclass(frozen=True, slots=True)
class LiveValue(Generic[T]):
    """The latest of one device.

    Attributes:
        value: what it answered last; None before the first answer.
        age_s: how long ago that was, s; infinite before the first answer.
        problem: why the question after that failed; empty if it did not.
    """

    value: T | None = None
    age_s: float = float("inf")
    problem: str = ""


@dataclass(frozen=True, slots=True)
class LiveSnapshot:
    """All devices at one moment.

    Attributes:
        gauges: readings in the gauges' own zero and direction, mm, by the gauge's name.
        encoders: the six slider positions.
        controller: whether it may move, and its complaints.
        stop_reason: why motion is forbidden; empty while it is not.
    """

    gauges: dict[str, LiveValue[GaugeReading]]
    encoders: LiveValue[EncoderSample]
    controller: LiveValue[ControllerStatus]
    stop_reason: LiveValue[str]


class _Latest(Generic[T]):
    """The latest answer of one device, and the time it came."""

    def __init__(self, live: LiveValues) -> None:
        self._live = live
        self._value: LiveValue[T] = LiveValue()
        self._at_s = float("-inf")

    async def of(self, asking: Awaitable[T]) -> T:
        """Wait for an answer and keep it, or why there is none."""
        try:
            value = await asking
        except HexacellError as error:
            self._value = replace(self._value, problem=str(error))
            self._live.notify()
            raise
        self._value, self._at_s = LiveValue(value), self._live.now()
        self._live.notify()
        return value

    def at(self, now_s: float) -> LiveValue[T]:
        """The latest answer with its age at a time."""
        return replace(self._value, age_s=now_s - self._at_s)


class LiveValues:
    """The latest values of the devices given to :meth:`observe`; ``now`` gives seconds."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self._gauges: dict[str, _Latest[GaugeReading]] = {}
        self._encoders: _Latest[EncoderSample] = _Latest(self)
        self._controller: _Latest[ControllerStatus] = _Latest(self)
        self._stop_reason: _Latest[str] = _Latest(self)
        self._subscribers: set[asyncio.Event] = set()

    def observe(self, devices: Devices) -> Devices:
        """The same devices, whose answers are kept here as well."""
        self._gauges = {mounted.gauge.name: _Latest(self) for mounted in devices.gauges}
        return replace(
            devices,
            gauges=tuple(
                replace(mounted, gauge=_ObservedGauge(mounted.gauge, self._gauges[mounted.gauge.name]))
                for mounted in devices.gauges
            ),
            encoders=_ObservedEncoders(devices.encoders, self._encoders),
            controller=_ObservedController(devices.controller, self._controller),
            stop_input=_ObservedStopInput(devices.stop_input, self._stop_reason),
        )

    def snapshot(self) -> LiveSnapshot:
        """What all devices show now."""
        now_s = self.now()
        return LiveSnapshot(
            gauges={name: latest.at(now_s) for name, latest in self._gauges.items()},
            encoders=self._encoders.at(now_s),
            controller=self._controller.at(now_s),
            stop_reason=self._stop_reason.at(now_s),
        )

    async def changes(self, period_s: float = SAMPLE_PERIOD_S) -> AsyncIterator[LiveSnapshot]:
        """A snapshot after each change, at most one every ``period_s`` seconds, until cancelled."""
        changed = asyncio.Event()
        self._subscribers.add(changed)
        try:
            while True:
                await changed.wait()
                changed.clear()
                yield self.snapshot()
                await asyncio.sleep(period_s)
        finally:
            self._subscribers.discard(changed)

    def notify(self) -> None:
        """Wake the subscribers."""
        for changed in self._subscribers:
            changed.set()


@dataclass(frozen=True, slots=True)
class _ObservedGauge:
    gauge: Gauge
    latest: _Latest[GaugeReading]

    @property
    def name(self) -> str:
        return self.gauge.name

    async def open(self) -> DeviceIdentity:
        return await self.gauge.open()

    async def read(self) -> GaugeReading:
        return await self.latest.of(self.gauge.read())

    async def read_once(self) -> GaugeReading:
        return await self.latest.of(self.gauge.read_once())

    async def check(self) -> None:
        await self.gauge.check()

    async def close(self) -> None:
        await self.gauge.close()


@dataclass(frozen=True, slots=True)
class _ObservedEncoders:
    encoders: EncoderBank
    latest: _Latest[EncoderSample]

    async def open(self) -> tuple[DeviceIdentity, ...]:
        return await self.encoders.open()

    async def read(self) -> EncoderSample:
        return await self.latest.of(self.encoders.read())

    async def close(self) -> None:
        await self.encoders.close()


@dataclass(frozen=True, slots=True)
class _ObservedController:
    controller: Controller
    latest: _Latest[ControllerStatus]

    async def open(self) -> DeviceIdentity:
        return await self.controller.open()

    async def prepare(self) -> None:
        await self.controller.prepare()

    async def move(self, pose: Pose) -> None:
        await self.controller.move(pose)

    async def pose(self) -> Pose:
        return await self.controller.pose()

    async def status(self) -> ControllerStatus:
        return await self.latest.of(self.controller.status())

    async def stop(self) -> None:
        await self.controller.stop()

    async def reload(self) -> None:
        await self.controller.reload()

    async def close(self) -> None:
        await self.controller.close()


@dataclass(frozen=True, slots=True)
class _ObservedStopInput:
    stop_input: StopInput
    latest: _Latest[str]

    async def open(self) -> DeviceIdentity | None:
        return await self.stop_input.open()

    async def active_reason(self) -> str | None:
        return await self.latest.of(self._reason()) or None

    async def close(self) -> None:
        await self.stop_input.close()

    async def _reason(self) -> str:
        return await self.stop_input.active_reason() or ""
