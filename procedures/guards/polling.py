"""Asking one device again and again, without waiting for the others.

Watching all devices at once while something else goes on.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from drivers.gauges.errors import GaugeAtEnd, WrongAnswer
from drivers.interfaces import ControllerStatus, EncoderSample
from drivers.serial.port import FRAME_GAP_S
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.guards.rules import first_trip
from procedures.guards.snapshot import DeviceReport, GaugeDeviation, GuardLimits, Snapshot
from procedures.run.trips import Guard, Trip

T = TypeVar("T")

RECOVERY_S = FRAME_GAP_S
"""How long a line is left alone after an answer that made no sense, before anything is asked again."""


@dataclass(slots=True, eq=False)
class LineActivity:
    """What answers come over, and how long none has, s on the wall.

    Devices on one line are answered one after the other: while any of them is, none is silent.
    """

    silent_s: float = 0.0


class DevicePoller(Generic[T]):
    """One device under watch: what was heard of it, and in ``looks`` how often that made sense.

    ``ask`` gives the value now or raises.
    """

    def __init__(
        self, device: str, ask: Callable[[], Awaitable[T]], pause_s: float, line: LineActivity | None = None
    ) -> None:
        self.answer_count = 0
        self.line = line or LineActivity()
        self._heard: DeviceReport[T] = DeviceReport(device)
        self._ask = ask
        self._pause_s = pause_s

    @property
    def report(self) -> DeviceReport[T]:
        """The latest of it."""
        return replace(self._heard, silent_s=self.line.silent_s)

    async def run(self, clock: CellClock, news: Callable[[], None]) -> None:
        """Ask until cancelled; ``news`` is called after every answer and every failure."""
        while True:
            self._heard = await self._look()
            self.answer_count += not self._heard.garbled_count
            news()
            await clock.sleep(self._pause_s * clock.factor)

    async def _look(self) -> DeviceReport[T]:
        try:
            value = await self._ask()
        except WrongAnswer as error:
            self.line.silent_s = -RECOVERY_S
            return replace(self._heard, error=error, garbled_count=self._heard.garbled_count + 1)
        except GaugeAtEnd as error:
            self.line.silent_s = 0.0
            return replace(self._heard, error=error, garbled_count=0)
        except HexacellError as error:
            return replace(self._heard, error=error, garbled_count=0)
        self.line.silent_s = 0.0
        first = value if self._heard.first is None else self._heard.first
        return replace(self._heard, value=value, first=first, error=None, garbled_count=0)


TICK_S = 0.01
"""How often silence is looked for, s on the wall."""

MAX_DELAY_S = 0.02
"""The longest that this process may be late and still be sure that it would have heard an answer."""


@dataclass(frozen=True, slots=True)
class DevicePollers:
    """What is watched; a lane that is not there is not."""

    gauges: tuple[DevicePoller[GaugeDeviation], ...] = ()
    encoders: DevicePoller[EncoderSample] | None = None
    controller: DevicePoller[ControllerStatus] | None = None
    stop_input: DevicePoller[str] | None = None

    def all(self) -> tuple[DevicePoller[Any], ...]:
        """All that are there."""
        rest = (self.encoders, self.controller, self.stop_input)
        return (*self.gauges, *(lane for lane in rest if lane is not None))

    def snapshot(self) -> Snapshot:
        """What they have heard by now."""
        return Snapshot(
            gauges=tuple(lane.report for lane in self.gauges),
            encoders=_heard(self.encoders),
            controller=_heard(self.controller),
            stop_input=_heard(self.stop_input),
        )


def _heard(lane: DevicePoller[T] | None) -> DeviceReport[T] | None:
    return None if lane is None else lane.report


@dataclass(eq=False)
class GuardMonitor:
    """Keeps asking from ``async with`` to its end; ``trip`` is the first guard that tripped.

    A process that gets no turn for a while is deaf, but its devices are not silent: of the time that
    has passed between two ticks no more counts than ``TURN_S`` beyond one.
    """

    pollers: DevicePollers
    limits: GuardLimits
    clock: CellClock
    trip: Trip | None = None
    _news: asyncio.Event = field(default_factory=asyncio.Event)
    _tripped: asyncio.Event = field(default_factory=asyncio.Event)
    _broken: BaseException | None = None
    _tasks: tuple[asyncio.Task[None], ...] = ()

    async def __aenter__(self) -> Self:
        runs = [lane.run(self.clock, self._judge) for lane in self.pollers.all()]
        self._tasks = tuple(asyncio.ensure_future(run) for run in (*runs, self._tick()))
        for task in self._tasks:
            task.add_done_callback(self._end_of)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def wait_for(self, doing: asyncio.Future[Any]) -> None:
        """Wait until something is done or a guard trips; raises what broke the patrol itself."""
        tripping = asyncio.ensure_future(self._tripped.wait())
        try:
            await asyncio.wait([doing, tripping], return_when=asyncio.FIRST_COMPLETED)
        finally:
            tripping.cancel()
        self._raise_broken()

    async def poll_all(self) -> Trip | None:
        """Wait until each device was asked once more, or one stays silent; the trip, if there is one.

        Nothing moves meanwhile, so what trips first is not in a hurry: it is named with all the rest.
        """
        marks = [(lane, lane.answer_count) for lane in self.pollers.all()]
        while not self._is_over() and any(lane.answer_count <= mark for lane, mark in marks):
            self._news.clear()
            await self._news.wait()
        self._raise_broken()
        self.trip = first_trip(self.pollers.snapshot(), self.limits) or self.trip
        return self.trip

    async def _tick(self) -> None:
        before = self.clock.now()
        while True:
            await self.clock.sleep(TICK_S * self.clock.factor)
            now = self.clock.now()
            passed = min(self.clock.on_the_wall(now - before), TICK_S + MAX_DELAY_S)
            before = now
            for line in {lane.line for lane in self.pollers.all()}:
                line.silent_s += passed
            self._judge()

    def _is_over(self) -> bool:
        """Whether waiting is in vain: a device is silent, or the patrol itself broke."""
        return self._broken is not None or (self.trip is not None and self.trip.guard is Guard.STALE)

    def _judge(self) -> None:
        if self.trip is None:
            self.trip = first_trip(self.pollers.snapshot(), self.limits)
        if self.trip is not None:
            self._tripped.set()
        self._news.set()

    def _raise_broken(self) -> None:
        if self._broken is not None:
            raise self._broken

    def _end_of(self, task: asyncio.Task[None]) -> None:
        """A lane that broke must not leave anybody waiting for it."""
        if not task.cancelled() and (error := task.exception()) is not None:
            self._broken = self._broken or error
            self._tripped.set()
            self._news.set()
