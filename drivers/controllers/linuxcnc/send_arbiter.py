"""Which of our connections may send a command now.

LinuxCNC 2.9 reads the commands of all clients with one ``strtok()``: two commands that arrive at the
same moment garble each other. A query is answered within a millisecond. A command may take as long as
a move, but ``PARSED_S`` after it was sent the server has read it, and another connection may send.

=================  ==============================  =========================================
connection         sends within                    waits for
=================  ==============================  =========================================
for commands       ``command_turn``                the end of a stop, then the line
for status         ``query_turn``                  the line
opening either     ``exclusive``                   the line, which it keeps until greeted
for a stop         no turn                         nothing, except another stop
=================  ==============================  =========================================
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

PARSED_S = 0.02


class SendArbiter:
    """Two locks shared by the connections to one server: the line, and a stop in progress."""

    def __init__(self) -> None:
        self._line = asyncio.Lock()
        self._stop = asyncio.Lock()

    @asynccontextmanager
    async def query_turn(self) -> AsyncIterator[None]:
        """Send inside; the line is released after ``PARSED_S`` even if the answer is still awaited."""
        await self._line.acquire()
        release = _ReleaseOnce(self._line)
        timer = asyncio.get_running_loop().call_later(PARSED_S, release)
        try:
            yield
        finally:
            timer.cancel()
            release()

    @asynccontextmanager
    async def command_turn(self) -> AsyncIterator[None]:
        """The same, but not before a stop in progress has ended."""
        await self.stop_ended()
        async with self.query_turn():
            yield

    @asynccontextmanager
    async def exclusive(self) -> AsyncIterator[None]:
        """Send inside, however long it takes; no other connection sends meanwhile."""
        async with self._line:
            yield

    @asynccontextmanager
    async def stopping(self) -> AsyncIterator[None]:
        """Stop the machine inside: no command is sent meanwhile; stops run one after another."""
        async with self._stop:
            yield

    async def stop_ended(self) -> None:
        """Wait until no stop is in progress."""
        async with self._stop:
            pass


class _ReleaseOnce:
    """Releases a lock at the first call."""

    def __init__(self, lock: asyncio.Lock) -> None:
        self._lock: asyncio.Lock | None = lock

    def __call__(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()
