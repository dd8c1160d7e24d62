"""Polling of the supervised devices, and the monitor that evaluates the guards.

- :class:`DevicePoller`, one task a device: read it, keep the latest report, pause, read again.
- :class:`LineActivity`, one a communication line: the time since the last answer on it. Devices on
  one line are read one after the other, so an answer of one shows that the line works for all.
- :class:`GuardMonitor`: runs the pollers and a timer. After each answer and each tick it evaluates
  the rules on a snapshot of all reports and keeps the first trip.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from drivers.errors import GaugeAtEnd, WrongAnswer
from drivers.interfaces import ControllerStatus, EncoderSample
from drivers.serial.port import FRAME_GAP_S
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.guards.rules import first_trip
from procedures.guards.snapshot import DeviceReport, GaugeDeviation, GuardLimits, Snapshot
from procedures.run.trips import Guard, Trip

T = TypeVar("T")

RECOVERY_S = FRAME_GAP_S
"""Silence that the driver requires after a garbled answer; it does not count against the device."""

TICK_S = 0.01
"""Period of the timer that looks for silent devices, s of real time."""

MAX_DELAY_S = 0.02
"""Longest scheduling delay of this process that counts as silence of a device, s of real time."""


@dataclass(slots=True, eq=False)
class LineActivity:
    """Time since the last answer on a communication line, s of real time."""

    silent_s: float = 0.0


class DevicePoller(Generic[T]):
    """Polls one device.

    Attributes:
        answer_count: how many answers were not garbled.
        line: the line on which the device answers.
    """

    def __init__(
        self,
        device: str,
        read: Callable[[], Awaitable[T]],
        pause_s: float,
        line: LineActivity | None = None,
    ) -> None:
        self.answer_count = 0
        self.line = line or LineActivity()
        self._report: DeviceReport[T] = DeviceReport(device)
        self._read = read
        self._pause_s = pause_s

    @property
    def report(self) -> DeviceReport[T]:
        """The latest report."""
        return replace(self._report, silent_s=self.line.silent_s)

    async def run(self, clock: CellClock, on_report: Callable[[], None]) -> None:
        """Poll until cancelled; ``on_report`` is called after every answer and every failure."""
        while True:
            self._report = await self._poll()
            self.answer_count += not self._report.garbled_count
            on_report()
            await clock.sleep(self._pause_s * clock.factor)

    async def _poll(self) -> DeviceReport[T]:
        last = self._report
        try:
            value = await self._read()
        except WrongAnswer as error:
            self.line.silent_s = -RECOVERY_S
            return replace(last, error=error, garbled_count=last.garbled_count + 1)
        except GaugeAtEnd as error:
            self.line.silent_s = 0.0
            return replace(last, error=error, garbled_count=0)
        except HexacellError as error:
            return replace(last, error=error, garbled_count=0)
        self.line.silent_s = 0.0
        first = value if last.first is None else last.first
        return replace(last, value=value, first=first, error=None, garbled_count=0)


@dataclass(frozen=True, slots=True)
class DevicePollers:
    """The pollers of one action; a device without a poller is not supervised."""

    gauges: tuple[DevicePoller[GaugeDeviation], ...] = ()
    encoders: DevicePoller[EncoderSample] | None = None
    controller: DevicePoller[ControllerStatus] | None = None
    stop_input: DevicePoller[str] | None = None

    def all(self) -> tuple[DevicePoller[Any], ...]:
        """Every poller there is."""
        others = (self.encoders, self.controller, self.stop_input)
        return (*self.gauges, *(poller for poller in others if poller is not None))

    def snapshot(self) -> Snapshot:
        """The latest reports of all devices."""
        return Snapshot(
            gauges=tuple(poller.report for poller in self.gauges),
            encoders=_report(self.encoders),
            controller=_report(self.controller),
            stop_input=_report(self.stop_input),
        )


def _report(poller: DevicePoller[T] | None) -> DeviceReport[T] | None:
    return None if poller is None else poller.report


@dataclass(eq=False)
class GuardMonitor:
    """Polls within ``async with``; ``trip`` is the first guard that tripped.

    If this process itself was not scheduled for a while, its devices are not to blame: between two
    ticks at most ``TICK_S + MAX_DELAY_S`` count as silence.
    """

    pollers: DevicePollers
    limits: GuardLimits
    clock: CellClock
    trip: Trip | None = None
    _updated: asyncio.Event = field(default_factory=asyncio.Event)
    _ended: asyncio.Event = field(default_factory=asyncio.Event)  # a guard tripped, or a task failed
    _failure: BaseException | None = None
    _tasks: tuple[asyncio.Task[None], ...] = ()

    async def __aenter__(self) -> Self:
        polling = [poller.run(self.clock, self._evaluate) for poller in self.pollers.all()]
        self._tasks = tuple(asyncio.ensure_future(task) for task in (*polling, self._measure_silence()))
        for task in self._tasks:
            task.add_done_callback(self._on_task_end)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
        reports are in: the trip then names every faulty device, not only the first one.
        """
        before = [(poller, poller.answer_count) for poller in self.pollers.all()]
        while not self._is_waiting_useless() and any(poller.answer_count <= n for poller, n in before):
            self._updated.clear()
            await self._updated.wait()
        self._raise_failure()
        self.trip = first_trip(self.pollers.snapshot(), self.limits) or self.trip
        return self.trip

    async def _measure_silence(self) -> None:
        before = self.clock.now()
        while True:
            await self.clock.sleep(TICK_S * self.clock.factor)
            now = self.clock.now()
            elapsed = min(self.clock.real_seconds(now - before), TICK_S + MAX_DELAY_S)
            before = now
            for line in {poller.line for poller in self.pollers.all()}:
                line.silent_s += elapsed
            self._evaluate()

    def _evaluate(self) -> None:
        if self.trip is None:
            self.trip = first_trip(self.pollers.snapshot(), self.limits)
        if self.trip is not None:
            self._ended.set()
        self._updated.set()

    def _is_waiting_useless(self) -> bool:
        """Whether a device is silent, or the monitor itself failed."""
        return self._failure is not None or (self.trip is not None and self.trip.guard is Guard.STALE)

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _on_task_end(self, task: asyncio.Task[None]) -> None:
        """Release everybody who waits if a task has failed."""
        if not task.cancelled() and (error := task.exception()) is not None:
            self._failure = self._failure or error
            self._ended.set()
            self._updated.set()
