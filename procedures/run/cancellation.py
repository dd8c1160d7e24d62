"""Coroutines that must run to their end although the caller is cancelled.

The caller's ``asyncio.CancelledError`` is raised when they have ended.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


async def shielded(action: Coroutine[Any, Any, Result]) -> Result:
    """Wait for an action to its end, however often the caller is cancelled."""
    task = asyncio.ensure_future(action)
    was_cancelled = await _end_of(task)
    result = task.result()
    if was_cancelled:
        raise asyncio.CancelledError
    return result


async def cancel_and_wait(task: asyncio.Future[Any]) -> None:
    """Cancel a task and wait for its end, however often the caller is cancelled."""
    task.cancel()
    was_cancelled = await _end_of(task)
    if not task.cancelled():
        task.exception()  # asyncio reports an error that was never asked for
    if was_cancelled:
        raise asyncio.CancelledError


async def _end_of(task: asyncio.Future[Any]) -> bool:
    """Wait for it; whether the waiting was cancelled meanwhile."""
    was_cancelled = False
    while not task.done():
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            was_cancelled = True
    return was_cancelled


async def in_thread(
    work: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """Run work in a thread. It may write files, so a cancelled caller waits for its end."""
    return await shielded(asyncio.to_thread(work, *args, **kwargs))
