"""A worker thread: blocking jobs run on it one at a time, on behalf of coroutines.

An executor of the standard library does the same with a lock, a condition and three more calls of the event
loop a job, which is a tenth of a round of encoders on a fast bus.
"""

import asyncio
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from queue import SimpleQueue
from typing import TypeVar

Result = TypeVar("Result")
Jobs = SimpleQueue[Callable[[], object] | None]
"""Jobs to be done; None is the end."""


class WorkerThread:
    """Runs blocking jobs in order.

    If a coroutine is cancelled, its job still ends before the next one begins, so that requests and
    responses stay synchronized; a waiting job is dropped. A job checks ``closing`` at least every 200 ms
    and raises if it is set.
    """

    def __init__(self, name: str) -> None:
        self.closing = threading.Event()
        self._jobs: Jobs = SimpleQueue()
        self._thread = threading.Thread(target=_work, args=(self._jobs,), name=name, daemon=True)
        weakref.finalize(self, self._jobs.put, None)

    def submit(self, job: Callable[[], object]) -> None:
        """Run ``job``, which raises nothing, after the jobs before it; nobody waits for it."""
        if self.closing.is_set():
            raise RuntimeError(f"the thread {self._thread.name} has ended")
        if self._thread.ident is None:
            self._thread.start()
        self._jobs.put(job)

    async def run(self, job: Callable[[], Result]) -> Result:
        """Run ``job`` after the jobs before it, and return its result."""
        return await self._begun(job)

    async def finish(self, job: Callable[[], None]) -> None:
        """Make the jobs end, run ``job`` as the last one, and end the thread; twice is harmless."""
        if self.closing.is_set():
            return
        finished = self._begun(job)
        self.closing.set()
        self._jobs.put(None)
        await asyncio.shield(finished)
        self._thread.join()

    def _begun(self, job: Callable[[], Result]) -> asyncio.Future[Result]:
        done: asyncio.Future[Result] = asyncio.get_running_loop().create_future()
        self.submit(partial(_carry_out, job, done))
        return done


def _work(jobs: Jobs) -> None:
    for job in iter(jobs.get, None):
        job()
        del job  # what it holds may go while the next one is awaited


def _carry_out(job: Callable[[], Result], done: asyncio.Future[Result]) -> None:
    if done.cancelled():
        return
    settle: Callable[[], None]
    try:
        settle = partial(done.set_result, job())
    except BaseException as error:  # every error belongs to the coroutine that waits
        settle = partial(done.set_exception, error)
    with suppress(RuntimeError):  # the event loop has ended, and nobody waits
        done.get_loop().call_soon_threadsafe(_settle, done, settle)


def _settle(done: asyncio.Future[Result], settle: Callable[[], None]) -> None:
    if not done.done():
        settle()
