"""The cell's clock: seconds as the cell lives them.

A real cell lives at the speed of the wall. A simulated one may run faster by the factor that its
cell file names; then windows, latencies and moves all shrink together and nothing else changes.
"""

from __future__ import annotations

import asyncio
import threading
import time


class CellClock:
    """Monotonic seconds of the cell, ``factor`` of them to a second on the wall."""

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = factor
        self._start = time.monotonic()

    def now(self) -> float:
        """Cell seconds since this clock was made."""
        return (time.monotonic() - self._start) * self.factor

    def on_the_wall(self, seconds: float) -> float:
        """How long ``seconds`` of the cell last on the wall, s."""
        return seconds / self.factor

    async def sleep(self, seconds: float) -> None:
        """Let ``seconds`` of the cell pass."""
        await asyncio.sleep(self.on_the_wall(seconds))

    def wait(self, seconds: float, until: threading.Event | None = None) -> bool:
        """The same for a thread; returns early and true when ``until`` is set."""
        if until is not None:
            return until.wait(self.on_the_wall(seconds))
        time.sleep(self.on_the_wall(seconds))
        return False
