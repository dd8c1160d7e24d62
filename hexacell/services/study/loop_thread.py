"""An event loop in a thread of its own, for a library that needs one under a program that has none."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from concurrent.futures import Future
from threading import Thread
from typing import Any, TypeVar

ResultType = TypeVar("ResultType")


class LoopThread:
    """A running event loop, until it is closed."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._run, name="event loop", daemon=True)
        self._thread.start()

    @property
    def is_closed(self) -> bool:
        """Whether it can begin nothing any more."""
        return self._loop.is_closed()

    def begin(self, coroutine: Coroutine[Any, Any, ResultType]) -> Future[ResultType]:
        """Run a coroutine; cancelling the future cancels it."""
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop)

    def close(self) -> None:
        """End the loop and the thread; what is under way is cancelled."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.get_loop().run_forever()
