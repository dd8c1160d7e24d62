"""Watching all devices at once while something else goes on."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self, TypeVar

from drivers.ports import ControllerStatus, EncoderRound
from hexacell.clock import CellClock
from procedures.guards.lanes import Lane
from procedures.guards.rules import first_trip
from procedures.guards.snapshot import Heard, Limits, PlungerSeen, Snapshot
from procedures.guards.trips import Guard, Trip

T = TypeVar("T")

TICK_S = 0.01
"""How often silence is looked for, s on the wall."""

TURN_S = 0.02
"""The longest that this process may be late and still be sure that it would have heard an answer."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """What is watched; a lane that is not there is not."""

    gauges: tuple[Lane[PlungerSeen], ...] = ()
    encoders: Lane[EncoderRound] | None = None
    controller: Lane[ControllerStatus] | None = None
    stop_line: Lane[str] | None = None

    def each(self) -> tuple[Lane[Any], ...]:
        """All that are there."""
        rest = (self.encoders, self.controller, self.stop_line)
        return (*self.gauges, *(lane for lane in rest if lane is not None))

    def snapshot(self) -> Snapshot:
        """What they have heard by now."""
        return Snapshot(
            gauges=tuple(lane.heard for lane in self.gauges),
            encoders=_heard(self.encoders),
            controller=_heard(self.controller),
            stop_line=_heard(self.stop_line),
        )


def _heard(lane: Lane[T] | None) -> Heard[T] | None:
    return None if lane is None else lane.heard


@dataclass(eq=False)
class Patrol:
    """Keeps asking from ``async with`` to its end; ``trip`` is the first guard that tripped.

    A process that gets no turn for a while is deaf, but its devices are not silent: of the time that
    has passed between two ticks no more counts than ``TURN_S`` beyond one.
    """

    lanes: Lanes
    limits: Limits
    clock: CellClock
    trip: Trip | None = None
    _news: asyncio.Event = field(default_factory=asyncio.Event)
    _tripped: asyncio.Event = field(default_factory=asyncio.Event)
    _broken: BaseException | None = None
    _tasks: tuple[asyncio.Task[None], ...] = ()

    async def __aenter__(self) -> Self:
        runs = [lane.run(self.clock, self._judge) for lane in self.lanes.each()]
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

    async def until(self, doing: asyncio.Future[Any]) -> None:
        """Wait until something is done or a guard trips; raises what broke the patrol itself."""
        tripping = asyncio.ensure_future(self._tripped.wait())
        try:
            await asyncio.wait([doing, tripping], return_when=asyncio.FIRST_COMPLETED)
        finally:
            tripping.cancel()
        self._raise_broken()

    async def asked_again(self) -> Trip | None:
        """Wait until each device was asked once more, or one stays silent; the trip, if there is one.

        Nothing moves meanwhile, so what trips first is not in a hurry: it is named with all the rest.
        """
        marks = [(lane, lane.looks) for lane in self.lanes.each()]
        while not self._is_over() and any(lane.looks <= mark for lane, mark in marks):
            self._news.clear()
            await self._news.wait()
        self._raise_broken()
        self.trip = first_trip(self.lanes.snapshot(), self.limits) or self.trip
        return self.trip

    async def _tick(self) -> None:
        before = self.clock.now()
        while True:
            await self.clock.sleep(TICK_S * self.clock.factor)
            now = self.clock.now()
            passed = min(self.clock.on_the_wall(now - before), TICK_S + TURN_S)
            before = now
            for line in {lane.line for lane in self.lanes.each()}:
                line.silent_s += passed
            self._judge()

    def _is_over(self) -> bool:
        """Whether waiting is in vain: a device is silent, or the patrol itself broke."""
        return self._broken is not None or (self.trip is not None and self.trip.guard is Guard.STALE)

    def _judge(self) -> None:
        if self.trip is None:
            self.trip = first_trip(self.lanes.snapshot(), self.limits)
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
