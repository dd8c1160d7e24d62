"""What must not be left half done: stopping the machine, letting devices go."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")


async def uninterrupted(action: Coroutine[Any, Any, Result]) -> Result:
    """Wait for an action to its end, however often the waiting is cancelled.

    Raises:
        asyncio.CancelledError: it was; raised when the action has ended.
    """
    task = asyncio.ensure_future(action)
    was_cancelled = False
    while not task.done():
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            was_cancelled = True
    result = task.result()
    if was_cancelled:
        raise asyncio.CancelledError
    return result
