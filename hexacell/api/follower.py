"""What goes on by itself, followed in a thread: for scripts, which wait, and notebooks, whose loop runs."""

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable, Coroutine
from concurrent.futures import CancelledError, Future
from contextlib import aclosing, suppress
from typing import Any, Generic, TypeVar

from hexacell.errors import UsageError

Item = TypeVar("Item")
Value = TypeVar("Value")


class Follower(Generic[Item]):
    """Reads ``items`` to their end, in a daemon thread with an event loop of its own.

    ``take`` is called there with each item, while nobody else looks. ``failure`` is what ended them.
    """

    def __init__(
        self, items: Callable[[], AsyncGenerator[Item, None]], take: Callable[[Item], None], name: str
    ) -> None:
        self.is_over = False
        self.failure: Exception | None = None
        self._items, self._take = items, take
        self._lock = threading.Lock()
        self._changed: Future[None] = Future()
        self._loop = asyncio.new_event_loop()
        self._reading: Future[asyncio.Task[None] | None] = Future()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def wait(self, ready: Callable[[], Value | None]) -> Value:
        """What ``ready`` gives as soon as it is not None; raises ``failure`` where it never will."""
        while isinstance(found := self._look(ready), Future):
            found.result()
        return found

    async def awaited(self, ready: Callable[[], Value | None]) -> Value:
        """The same, for a caller whose own event loop goes on meanwhile."""
        while isinstance(found := self._look(ready), Future):
            # Others wait for the same: who is cancelled does not cancel it.
            await asyncio.shield(asyncio.wrap_future(found))
        return found

    def call(self, work: Coroutine[Any, Any, Value], within_s: float) -> Value:
        """What some work in the thread gives; raises ``TimeoutError``, also where the thread ends."""
        try:
            return asyncio.run_coroutine_threadsafe(work, self._loop).result(within_s)
        except (RuntimeError, CancelledError) as error:
            work.close()
            raise TimeoutError(f"{self._thread.name} are over") from error

    def stop(self) -> None:
        """Follow no longer; returns when the items are closed and the thread has ended."""
        if (reading := self._reading.result()) is not None:
            with suppress(RuntimeError):  # the loop has just been closed
                self._loop.call_soon_threadsafe(reading.cancel)
        self._thread.join()

    def _look(self, ready: Callable[[], Value | None]) -> "Value | Future[None]":
        with self._lock:
            if (found := ready()) is not None:
                return found
            if self.is_over:
                raise self.failure or UsageError(f"{self._thread.name} are over", action="Begin anew")
            return self._changed

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            try:
                runner.run(self._read())
            except asyncio.CancelledError:
                pass
            except Exception as error:
                self.failure = error
            self._tell(None)

    async def _read(self) -> None:
        self._reading.set_result(asyncio.current_task())
        async with aclosing(self._items()) as items:
            async for item in items:
                self._tell(item)

    def _tell(self, item: Item | None) -> None:
        with self._lock:
            if item is None:
                self.is_over = True
            else:
                self._take(item)
            told, self._changed = self._changed, Future()
        told.set_result(None)
