"""Waiting in tests: until something is so, however long a machine takes for it.

No count of tries and no number of seconds stands in for an event. Where the event never comes, the
time-out that pytest has for each test ends the wait and shows what waited.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest

PAUSE_S = 0.002


def wait_until(condition: Callable[[], bool]) -> None:
    """Return as soon as ``condition`` holds; other threads and processes go on meanwhile."""
    while not condition():
        time.sleep(PAUSE_S)


async def until(condition: Callable[[], bool]) -> None:
    """The same on the event loop: other tasks go on meanwhile."""
    while not condition():  # noqa: ASYNC110 - threads and processes set no asyncio.Event
        await asyncio.sleep(PAUSE_S)


async def cancel(task: asyncio.Future[Any]) -> None:
    """Cancel it; it ends with the cancellation."""
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
