"""The wire trace: every byte sent and received on the lines to the devices, with its time."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

CAPACITY_BYTES = 16 << 20
"""Of memory."""

ENTRY_BYTES = 250
"""What an entry takes in memory beside its bytes: the most are of a few bytes."""


class TrafficDirection(StrEnum):
    """Direction of bytes, from the point of view of this program."""

    SENT = ">"
    RECEIVED = "<"


@dataclass(frozen=True, slots=True)
class TraceEntry:
    """Bytes that were transferred together: seconds since the epoch, URL of the line, direction."""

    time_s: float
    line: str
    direction: TrafficDirection
    data: bytes

    def __str__(self) -> str:
        """One line of text: time, line, direction, the bytes in hexadecimal and as characters."""
        return (
            f"{self.time_s:.6f} {self.line} {self.direction} {self.data.hex(' ')}  {_readable(self.data)}"
        )


TraceRecorder = Callable[[TraceEntry], None]
"""Receives entries in the thread of a line; it must neither block nor raise."""


class WireTrace:
    """A recorder that keeps the latest entries, in about ``capacity`` bytes of memory. Thread-safe.

    Attributes:
        dropped: how many older entries were dropped.
    """

    def __init__(self, capacity: int = CAPACITY_BYTES) -> None:
        self.dropped = 0
        self._capacity = capacity
        self._size = 0
        self._entries: deque[TraceEntry] = deque()
        self._lock = threading.Lock()

    def __call__(self, entry: TraceEntry) -> None:
        """Keep ``entry``; the oldest entries are dropped if necessary."""
        with self._lock:
            self._entries.append(entry)
            self._size += _size(entry)
            while self._size > self._capacity:
                self._size -= _size(self._entries.popleft())
                self.dropped += 1

    def entries(self) -> tuple[TraceEntry, ...]:
        """The kept entries, oldest first."""
        with self._lock:
            return tuple(self._entries)

    def text(self) -> str:
        """The trace as text, one entry a line; the first line says how many were dropped."""
        entries = self.entries()
        head = [f"# {self.dropped} earlier entries were forgotten"] if self.dropped else []
        return "".join(f"{line}\n" for line in (*head, *entries))


def _size(entry: TraceEntry) -> int:
    return ENTRY_BYTES + len(entry.data)


def _readable(data: bytes) -> str:
    return "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in data)
