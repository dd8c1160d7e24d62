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

import asyncio
import shutil
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self, TypeVar

from drivers.interfaces import Controller
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from hexacell.storage import atomic_files
from procedures.guards.polling import PolledDevices
from procedures.guards.rules import first_trip
from procedures.guards.rules.base import GuardLimits
from procedures.run.cancellation import cancel_and_wait, shielded
from procedures.run.trips import Guard, GuardTripped, Trip

Result = TypeVar("Result")
Supervised = Callable[[], Awaitable[Result]]

TICK_S = 0.01
"""Period of the timer that looks for silent devices, s of real time."""

MAX_DELAY_S = 0.02
"""Longest scheduling delay of this process that counts as silence of a device, s of real time."""


@dataclass(eq=False)
class MotionSupervisor:
    """Supervises actions. A trip is latched: no further action starts until ``clear`` is called."""

    controller: Controller
    clock: CellClock
    folder: Path
    free_disk_mb: float
    latched: Trip | None = None

    def clear(self) -> None:
        """Release the latch; the next action evaluates all guards again before it starts."""
        self.latched = None

    def check(self) -> None:
        """Raise ``GuardTripped`` while a trip is latched or the disk is nearly full."""
        if self.latched is not None:
            raise self.latched.as_error()
        if trip := low_disk_space(self.folder, self.free_disk_mb):
            raise self.latch(trip)

    def latch(self, trip: Trip) -> GuardTripped:
        """Latch a trip; returns the error to raise."""
        self.latched = trip
        return trip.as_error()

    async def stop(self, trip: Trip) -> GuardTripped:
        """Stop the robot, even if cancelled meanwhile, and latch; returns the error to raise."""
        try:
            await shielded(self.controller.stop())
        except HexacellError as error:
            trip = replace(trip, stop_failure=str(error))
        return self.latch(trip)

    async def supervise(
        self,
        action: Supervised[Result],
        devices: PolledDevices,
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
        async with GuardMonitor(devices, limits, self.clock) as monitor:
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
                await cancel_and_wait(task)

    async def _result(self, task: asyncio.Future[Result], monitor: "GuardMonitor") -> Result:
        try:
            return await task
        except HexacellError as error:
            if trip := await monitor.poll_all():
                raise await self.stop(trip) from error
            raise


@dataclass(eq=False)
class GuardMonitor:
    """Polls within ``async with``; ``trip`` is the first guard that tripped.

    If this process itself was not scheduled for a while, its devices are not to blame: between two
    ticks at most ``TICK_S + MAX_DELAY_S`` count as silence.
    """

    devices: PolledDevices
    limits: GuardLimits
    clock: CellClock
    trip: Trip | None = None
    _updated: asyncio.Event = field(default_factory=asyncio.Event)
    _ended: asyncio.Event = field(default_factory=asyncio.Event)  # a guard tripped, or a task failed
    _failure: BaseException | None = None
    _tasks: tuple[asyncio.Task[None], ...] = ()

    async def __aenter__(self) -> Self:
        polling = [poller.run(self.clock, self._evaluate) for poller in self.devices.all()]
        self._tasks = tuple(asyncio.ensure_future(task) for task in (*polling, self._measure_silence()))
        for task in self._tasks:
            task.add_done_callback(self._on_task_end)
        return self

    async def __aexit__(self, *_error: object) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def wait_for(self, action: asyncio.Future[Any]) -> None:
        """Wait until the action ends or a guard trips; raises an error of the monitor itself."""
        ended = asyncio.ensure_future(self._ended.wait())
        try:
            await asyncio.wait([action, ended], return_when=asyncio.FIRST_COMPLETED)
        finally:
            ended.cancel()
        self._raise_failure()

    async def poll_all(self) -> Trip | None:
        """Wait until every device has answered once more, or one is silent; the trip, if any.

        The robot is at a standstill meanwhile, so the rules are evaluated once more when all
        answers are in: the trip then names every faulty device, not only the first one.
        """
        before = [(poller, poller.answer_count) for poller in self.devices.all()]
        while any(poller.answer_count <= n for poller, n in before):
            is_silent = self.trip is not None and self.trip.guard is Guard.STALE
            if is_silent or self._failure is not None:
                break
            self._updated.clear()
            await self._updated.wait()
        self._raise_failure()
        self.trip = first_trip(self.devices, self.limits) or self.trip
        return self.trip

    async def _measure_silence(self) -> None:
        before = self.clock.now()
        while True:
            await self.clock.sleep(TICK_S * self.clock.factor)
            now = self.clock.now()
            elapsed = min(self.clock.real_seconds(now - before), TICK_S + MAX_DELAY_S)
            before = now
            for line in {poller.line for poller in self.devices.all()}:
                line.silent_s += elapsed
            self._evaluate()

    def _evaluate(self) -> None:
        if self.trip is None:
            self.trip = first_trip(self.devices, self.limits)
        if self.trip is not None:
            self._ended.set()
        self._updated.set()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _on_task_end(self, task: asyncio.Task[None]) -> None:
        """Release what waits if a task has failed."""
        if not task.cancelled() and (error := task.exception()) is not None:
            self._failure = self._failure or error
            self._ended.set()
            self._updated.set()


def low_disk_space(folder: Path, limit_mb: float) -> Trip | None:
    """The trip of a folder, which need not exist yet, with too little free space; raises ``FileError``."""
    there = next((path for path in (folder, *folder.parents) if path.exists()), folder)
    with atomic_files.os_errors("its free space cannot be determined", there):
        free_mb = shutil.disk_usage(there).free / 1e6
    if free_mb >= limit_mb:
        return None
    problem = f"only {free_mb:.0f} MB are free where the run is kept, less than {limit_mb:g} MB"
    return Trip(Guard.DISK, str(folder), problem, "Delete files there that nobody needs, then resume")
