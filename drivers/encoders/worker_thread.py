"""One thread that owns a link: blocking jobs run on it one at a time, behind coroutines."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TypeVar

from hexacell.errors import DeviceError

Result = TypeVar("Result")


class WorkerThread:
    """Runs blocking jobs in order; a cancelled one is told to stop and is seen to its end.

    A job looks at ``interrupted`` at least every 200 ms and raises when it is set, so that a
    cancelled coroutine returns soon and never leaves a job talking behind its back.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.cancelled = threading.Event()
        self._finished = False
        self._turn = asyncio.Lock()
        self._executor = ThreadPoolExecutor(1, thread_name_prefix=name)

    async def run(self, job: Callable[[], Result]) -> Result:
        """Run ``job`` when its turn comes and return what it returns.

        Raises:
            DeviceError: The link was closed meanwhile; or whatever ``job`` raises.
        """
        async with self._turn:
            if self._finished:
                raise DeviceError("was closed meanwhile", subject=self.name, action="Open it again")
            future = asyncio.get_running_loop().run_in_executor(self._executor, job)
            try:
                return await asyncio.shield(future)
            except asyncio.CancelledError:
                await self._see_off(future)
                raise

    async def finish(self, job: Callable[[], None]) -> None:
        """Interrupt the job that runs, run ``job`` as the last one, and end the thread."""
        self._finished = True
        self.cancelled.set()
        try:
            await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._executor, job))
        finally:
            self._executor.shutdown()

    async def _see_off(self, future: asyncio.Future[Result]) -> None:
        self.cancelled.set()
        try:
            await asyncio.wait([future])
            with suppress(Exception):
                future.result()
        finally:
            if not self._finished:
                self.cancelled.clear()
