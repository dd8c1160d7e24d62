"""A worker thread: blocking jobs run on it one at a time, on behalf of coroutines."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")


class WorkerThread:
    """Runs blocking jobs in order.

    If a coroutine is cancelled, its job still ends before the next one begins, so that requests and
    responses stay synchronized; a waiting job is dropped. A job checks ``closing`` at least every 200 ms
    and raises if it is set.
    """

    def __init__(self, name: str) -> None:
        self.closing = threading.Event()
        self._executor = ThreadPoolExecutor(1, thread_name_prefix=name)

    def submit(self, job: Callable[[], Result]) -> Future[Result]:
        """Run ``job`` after the jobs before it."""
        return self._executor.submit(job)

    async def run(self, job: Callable[[], Result]) -> Result:
        """Run ``job`` after the jobs before it, and return its result."""
        return await asyncio.wrap_future(self.submit(job))

    async def finish(self, job: Callable[[], None]) -> None:
        """Make the jobs end, run ``job`` as the last one, and end the thread; twice is harmless."""
        if self.closing.is_set():
            return
        self.closing.set()
        finished = self.submit(job)
        self._executor.shutdown(wait=False)
        await asyncio.shield(asyncio.wrap_future(finished))
        self._executor.shutdown()
