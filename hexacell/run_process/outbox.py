"""What one client is still to be told; a slow one delays nobody."""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import suppress

STUCK_S = 10.0
"""A client that takes nothing for so long is let go, s."""


class Outbox:
    """Messages to one client, in order. Of snapshots only the latest waits, and only behind all others.

    Args:
        writer: to the client.
        stuck_s: how long it may take nothing.
    """

    def __init__(self, writer: asyncio.StreamWriter, stuck_s: float = STUCK_S) -> None:
        writer.transport.set_write_buffer_limits(high=0)
        self._writer = writer
        self._stuck_s = stuck_s
        self._lines: deque[bytes] = deque()
        self._latest: bytes | None = None
        self._changed = asyncio.Event()
        self._is_closed = False

    def put(self, line: bytes) -> None:
        """Add a message that must arrive."""
        self._lines.append(line)
        self._changed.set()

    def offer(self, line: bytes) -> None:
        """Add a snapshot, which replaces one that still waits."""
        self._latest = line
        self._changed.set()

    def close(self) -> None:
        """Nothing more is added: it ends when all is told."""
        self._is_closed = True
        self._changed.set()

    async def deliver(self) -> None:
        """Send everything as the client takes it, until closed; raises ``OSError`` where it does not."""
        while (line := await self._next()) is not None:
            self._writer.write(line)
            try:
                await asyncio.wait_for(self._writer.drain(), self._stuck_s)
            except TimeoutError as error:
                self._writer.transport.abort()
                raise ConnectionAbortedError("the client takes nothing") from error

    async def end(self) -> None:
        """Close the connection."""
        self._writer.close()
        with suppress(OSError):
            await self._writer.wait_closed()

    async def _next(self) -> bytes | None:
        while not self._lines and self._latest is None and not self._is_closed:
            self._changed.clear()
            await self._changed.wait()
        if self._lines:
            return self._lines.popleft()
        line, self._latest = self._latest, None
        return None if self._is_closed else line
