"""Doing something under watch: it begins only if all is well, and ends when something is not."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar

from drivers.interfaces import Controller
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.guards import rules
from procedures.guards.polling import DevicePollers, GuardMonitor
from procedures.guards.rules import free_bytes
from procedures.guards.snapshot import GuardLimits
from procedures.run.cancellation import shielded
from procedures.run.trips import GuardTripped, Trip

Result = TypeVar("Result")
Supervised = Callable[[], Awaitable[Result]]


class MotionSupervisor:
    """Watches actions. What trips is latched: nothing begins any more until ``clear`` is called.

    Attributes:
        latched: what tripped, while it keeps everything from beginning.
    """

    def __init__(self, controller: Controller, clock: CellClock, folder: Path, free_disk_mb: float) -> None:
        self.latched: Trip | None = None
        self._controller = controller
        self._clock = clock
        self._folder = folder
        self._free_disk_mb = free_disk_mb

    def clear(self) -> None:
        """Somebody has seen to what tripped; all is looked at again before anything moves."""
        self.latched = None

    def check(self) -> None:
        """Refuse to begin while something is latched or the disk is filling up.

        Raises:
            GuardTripped: what it is.
        """
        if self.latched is not None:
            raise self.latched.as_error()
        if trip := rules.low_disk_space(str(self._folder), free_bytes(self._folder), self._free_disk_mb):
            raise self.latch(trip)

    def latch(self, trip: Trip) -> GuardTripped:
        """Let nothing begin any more; the error to raise."""
        self.latched = trip
        return trip.as_error()

    async def stop(self, trip: Trip) -> GuardTripped:
        """Stop the robot, however often the waiting is cancelled, and latch; the error to raise."""
        try:
            await shielded(self._controller.stop())
        except HexacellError as error:
            trip = trip.unstopped(str(error))
        return self.latch(trip)

    async def supervise(
        self, action: Supervised[Result], lanes: DevicePollers, limits: GuardLimits, ending_s: float = 0.0
    ) -> Result:
        """Watch over an action; it begins once every device under watch has answered.

        When a guard trips the robot is stopped, and the action has so many seconds of the wall to
        end by itself before it is cancelled.

        Raises:
            GuardTripped: a guard tripped; the robot stands, and the action has ended.
            HexacellError: the action failed by itself, and no guard knows why.
        """
        self.check()
        async with GuardMonitor(lanes, limits, self._clock) as patrol:
            if trip := await patrol.poll_all():
                raise self.latch(trip)
            doing = asyncio.ensure_future(action())
            try:
                await patrol.wait_for(doing)
                if patrol.trip is None:
                    return await self._result(doing, patrol)
                tripped = await self.stop(patrol.trip)
                await asyncio.wait([doing], timeout=ending_s)
                raise tripped
            finally:
                await shielded(_see_off(doing))

    async def _result(self, done: asyncio.Future[Result], patrol: GuardMonitor) -> Result:
        try:
            return await done
        except HexacellError as error:
            if trip := await patrol.poll_all():
                raise await self.stop(trip) from error
            raise


async def _see_off(doing: asyncio.Future[Any]) -> None:
    """Wait for the end of something that nobody wants to hear of any more."""
    doing.cancel()
    await asyncio.wait([doing])
    if not doing.cancelled():
        doing.exception()
