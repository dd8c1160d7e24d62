"""Supervision of one action: it starts only if no guard trips, and is stopped when one does.

::

    latched? --yes--> refuse
       | no
    start the monitor; every device must answer once --trip--> latch, refuse
       |
    start the action; wait for its end or a trip
       |- action ended      -> its result; an error is replaced by a trip that explains it
       |- a guard tripped   -> stop the robot, latch, wait for the action's end, cancel it
"""

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
    """Supervises actions. A trip is latched: no further action starts until ``clear`` is called.

    Attributes:
        latched: the latched trip, if any.
    """

    def __init__(self, controller: Controller, clock: CellClock, folder: Path, free_disk_mb: float) -> None:
        self.latched: Trip | None = None
        self._controller = controller
        self._clock = clock
        self._folder = folder
        self._free_disk_mb = free_disk_mb

    def clear(self) -> None:
        """Release the latch; the next action evaluates all guards again before it starts."""
        self.latched = None

    def check(self) -> None:
        """Refuse to start while a trip is latched or the disk is nearly full.

        Raises:
            GuardTripped: the reason.
        """
        if self.latched is not None:
            raise self.latched.as_error()
        if trip := rules.low_disk_space(str(self._folder), free_bytes(self._folder), self._free_disk_mb):
            raise self.latch(trip)

    def latch(self, trip: Trip) -> GuardTripped:
        """Latch a trip; returns the error to raise."""
        self.latched = trip
        return trip.as_error()

    async def stop(self, trip: Trip) -> GuardTripped:
        """Stop the robot, even if cancelled meanwhile, and latch; returns the error to raise."""
        try:
            await shielded(self._controller.stop())
        except HexacellError as error:
            trip = trip.unstopped(str(error))
        return self.latch(trip)

    async def supervise(
        self,
        action: Supervised[Result],
        pollers: DevicePollers,
        limits: GuardLimits,
        stop_grace_s: float = 0.0,
    ) -> Result:
        """Run an action under supervision; it starts once every supervised device has answered.

        When a guard trips, the robot is stopped. The action then has ``stop_grace_s`` of real time to
        end before it is cancelled.

        Raises:
            GuardTripped: a guard tripped; the robot is at a standstill and the action has ended.
            HexacellError: the action failed, and no guard explains it.
        """
        self.check()
        async with GuardMonitor(pollers, limits, self._clock) as monitor:
            if trip := await monitor.poll_all():
                raise self.latch(trip)
            task = asyncio.ensure_future(action())
            try:
                await monitor.wait_for(task)
                if monitor.trip is None:
                    return await self._result(task, monitor)
                tripped = await self.stop(monitor.trip)
                await asyncio.wait([task], timeout=stop_grace_s)
                raise tripped
            finally:
                await shielded(_cancel_and_wait(task))

    async def _result(self, task: asyncio.Future[Result], monitor: GuardMonitor) -> Result:
        try:
            return await task
        except HexacellError as error:
            if trip := await monitor.poll_all():
                raise await self.stop(trip) from error
            raise


async def _cancel_and_wait(task: asyncio.Future[Any]) -> None:
    """End a task whose result is no longer needed."""
    task.cancel()
    await asyncio.wait([task])
    if not task.cancelled():
        task.exception()
