"""Who may speak: two connections of ours must never be heard at the same moment.

LinuxCNC 2.9 reads the commands of all clients with one ``strtok()``, so two that coincide garble each
other's. A question is answered within a millisecond and is waited for. An order may take as long as
a move; after ``PARSED_S`` the server has read it and others may speak.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

PARSED_S = 0.02


class SendArbiter:
    """One speaker at a time, on the connections that share it."""

    def __init__(self) -> None:
        self._lock = asyncio.Lock()

    @asynccontextmanager
    async def taken(self) -> AsyncIterator[None]:
        """Speak inside; whoever waits longer than ``PARSED_S`` for an answer only listens by then."""
        await self._lock.acquire()
        turn = _Turn(self._lock)
        timer = asyncio.get_running_loop().call_later(PARSED_S, turn.end)
        try:
            yield
        finally:
            timer.cancel()
            turn.end()

    @asynccontextmanager
    async def kept(self) -> AsyncIterator[None]:
        """Speak inside, and let nobody else speak however long it takes."""
        async with self._lock:
            yield


class _Turn:
    """A lock that is given back once, by whoever comes first."""

    def __init__(self, lock: asyncio.Lock) -> None:
        self._lock: asyncio.Lock | None = lock

    def end(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()
