"""The devices that a screen watches while no run has them."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from hexacell.errors import HexacellError
from hexacell.run_process.live_snapshot import LiveSnapshot
from procedures.run.cancellation import cancel_and_wait

AGAIN_AFTER_S = 3.0
"""Devices that could not be opened are tried again."""


class DeviceWatcher:
    """Watches until it is stopped; lets the devices go while they are needed elsewhere.

    Attributes:
        live: the latest values, and ``live_at_s`` when they came.
        problem: why there are no values; empty if there are.
        watch: gives what the devices show; ``on_change`` is called when that has changed.
    """

    def __init__(
        self,
        watch: Callable[[], AsyncIterator[LiveSnapshot]],
        now: Callable[[], float],
        on_change: Callable[[], None],
    ) -> None:
        self.live: LiveSnapshot | None = None
        self.live_at_s = 0.0
        self.problem = ""
        self.watch, self.on_change, self._now = watch, on_change, now
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Watch the devices, unless it does."""
        if self._task is None:
            self._task = asyncio.create_task(self._keep_watching())

    async def stop(self) -> None:
        """Let the devices go."""
        task, self._task, self.live = self._task, None, None
        if task is not None:
            await cancel_and_wait(task)

    @asynccontextmanager
    async def released(self) -> AsyncIterator[None]:
        """Within this context others may have the devices."""
        was_watching = self._task is not None
        await self.stop()
        try:
            yield
        finally:
            if was_watching:
                self.start()

    async def _keep_watching(self) -> None:
        while True:
            try:
                async for snapshot in self.watch():
                    self.live, self.live_at_s, self.problem = snapshot, self._now(), ""
                    self.on_change()
            except HexacellError as error:
                self.live, self.problem = None, str(error)
                self.on_change()
            await asyncio.sleep(AGAIN_AFTER_S)
