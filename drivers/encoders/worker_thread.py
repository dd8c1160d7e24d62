"""A worker thread: blocking jobs run on it one at a time, on behalf of coroutines."""

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
    """Runs blocking jobs in order; cancelling a coroutine cancels its job and waits for its end.

    A job checks ``cancelled`` at least every 200 ms and raises if it is set. A cancelled coroutine
    therefore returns soon, and its job no longer uses the device.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.cancelled = threading.Event()
        self._finished = False
        self._turn = asyncio.Lock()
        self._executor = ThreadPoolExecutor(1, thread_name_prefix=name)

    async def run(self, job: Callable[[], Result]) -> Result:
        """Run ``job`` after the jobs before it, and return its result.

        Raises:
            DeviceError: The thread was ended meanwhile; or any error of ``job``.
        """
        async with self._turn:
            if self._finished:
                raise DeviceError("was closed meanwhile", subject=self.name, action="Open it again")
            future = asyncio.get_running_loop().run_in_executor(self._executor, job)
            try:
                return await asyncio.shield(future)
            except asyncio.CancelledError:
                await self._cancel_job(future)
                raise

    async def finish(self, job: Callable[[], None]) -> None:
        """Cancel the running job, run ``job`` as the last one, and end the thread."""
        self._finished = True
        self.cancelled.set()
        try:
            await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._executor, job))
        finally:
            self._executor.shutdown()

    async def _cancel_job(self, future: asyncio.Future[Result]) -> None:
        self.cancelled.set()
        try:
            await asyncio.wait([future])
            with suppress(Exception):
                future.result()
        finally:
            if not self._finished:
                self.cancelled.clear()
