"""The cell's clock.

In a real cell it runs in real time. In a simulated one it may run faster by the factor in the cell file;
then windows, latencies and moves all become shorter by that factor and nothing else changes.
"""

import asyncio
import threading
import time


class CellClock:
    """Monotonic cell seconds, ``factor`` of them in one second of real time."""

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = factor
        self._start = time.monotonic()

    def now(self) -> float:
        """Cell seconds since this clock was created."""
        return (time.monotonic() - self._start) * self.factor

    def real_seconds(self, seconds: float) -> float:
        """The duration of ``seconds`` of the cell in real time, s."""
        return seconds / self.factor

    async def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of the cell."""
        await asyncio.sleep(self.real_seconds(seconds))

    async def sleep_until(self, moment_s: float) -> None:
        """Wait until ``now()`` is ``moment_s``; where that has passed, only let others go on."""
        await self.sleep(max(0.0, moment_s - self.now()))

    def wait(self, seconds: float, until: threading.Event) -> None:
        """Sleep in a thread; returns early when ``until`` is set."""
        until.wait(self.real_seconds(seconds))


class Patience:
    """The time left for an answer that is waited for in slices.

    Where a slice took longer, this process was not scheduled, and the device is not to blame: no more than
    the slice counts.
    """

    def __init__(self, seconds: float, slice_s: float, now_s: float) -> None:
        self._left_s, self._slice_s, self._seen_s = seconds, slice_s, now_s

    def left_s(self, now_s: float) -> float:
        """Seconds that are left; to be asked once a slice."""
        self._left_s -= min(now_s - self._seen_s, self._slice_s)
        self._seen_s = now_s
        return self._left_s
