"""What the devices of a running calibration showed last, for screens.

:class:`~procedures.devices.device_set.Devices` keeps here every answer that the run needs: those of the
guards, several a second while the robot moves, and those of records. No device is asked for a screen, so
watching changes neither the traffic nor the timing of a run. Only the latest value of each device is
kept; a slow subscriber misses values and delays nothing.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from typing import Generic, TypeVar

from drivers.interfaces import ControllerStatus, EncoderSample, GaugeReading
from hexacell.errors import HexacellError

T = TypeVar("T")

SAMPLE_PERIOD_S = 0.1
"""The shortest time between two changes that one subscriber is notified of, s."""


class LiveValue(Generic[T]):
    """The latest of one device.

    Attributes:
        value: what it answered last; None before the first answer.
        problem: why it failed to answer after that; empty if it did not.
        at_s: when it answered, by the clock of all values.
    """

    def __init__(self, live: LiveValues) -> None:
        self.value: T | None = None
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

    async def of(self, read: Callable[[], Awaitable[T]]) -> T:
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
    """The latest values of all devices; ``now`` gives seconds.

    Attributes:
        encoders: the six joint variables.
        controller: whether it may move, and its error messages.
        stop_reason: why motion is forbidden; empty while it is not.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.encoders: LiveValue[EncoderSample] = LiveValue(self)
        self.controller: LiveValue[ControllerStatus] = LiveValue(self)
        self.stop_reason: LiveValue[str] = LiveValue(self)
        self._gauges: dict[str, LiveValue[GaugeReading]] = {}
        self._subscribers: set[asyncio.Event] = set()

    def gauge(self, name: str) -> LiveValue[GaugeReading]:
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
