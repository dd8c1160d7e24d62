"""The wire trace: every byte sent and received on the lines to the devices, with its time."""

import logging
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from operator import itemgetter

from hexacell.errors import FileError

CAPACITY_BYTES = 16 << 20
"""Memory for the trace of each line."""

ENTRY_BYTES = 300
"""What an entry takes in memory beside its bytes: the most are of a few bytes."""

ENTRY = re.compile(
    r"(?P<time_s>\d+\.\d+) (?P<line>.+) (?P<direction>[<>]) (?P<bytes>[0-9a-f]{2}(?: [0-9a-f]{2})*)  .*"
)


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
        readable = "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in self.data)
        return f"{self.time_s:.6f} {self.line} {self.direction} {self.data.hex(' ')}  {readable}"


TraceRecorder = Callable[[TraceEntry], None]
"""Receives entries in the thread of a line; it must neither block nor raise."""

_log = logging.getLogger("drivers.wire")


class LineRecord:
    """Passes the bytes of one line to a recorder, if there is one, and to the log (DEBUG)."""

    def __init__(self, line: str, recorder: TraceRecorder | None) -> None:
        self._line = line
        self._recorder = recorder

    @property
    def is_on(self) -> bool:
        """Whether anybody wants the bytes."""
        return self._recorder is not None or _log.isEnabledFor(logging.DEBUG)

    def add(self, direction: TrafficDirection, data: bytes) -> None:
        """Record bytes that are transferred at this moment."""
        if not data or not self.is_on:
            return
        entry = TraceEntry(time.time(), self._line, direction, data)
        if self._recorder is not None:
            self._recorder(entry)
        _log.debug("%s", entry)


class WireTrace:
    """A recorder that keeps the latest entries of each line, in about ``capacity`` bytes of memory a line.

    Thread-safe. A busy line, such as that of encoders, takes nothing from the others.
    """

    def __init__(self, capacity: int = CAPACITY_BYTES) -> None:
        self._capacity = capacity
        self._lines: dict[str, _LineTrace] = {}
        self._count = 0
        self._lock = threading.Lock()

    def __call__(self, entry: TraceEntry) -> None:
        """Keep ``entry``; the oldest entries of its line are dropped if necessary."""
        with self._lock:
            self._count += 1
            self._lines.setdefault(entry.line, _LineTrace(self._capacity)).add(self._count, entry)

    @property
    def dropped(self) -> dict[str, int]:
        """How many older entries were dropped, by line."""
        with self._lock:
            return {name: line.dropped for name, line in self._lines.items() if line.dropped}

    def entries(self) -> tuple[TraceEntry, ...]:
        """The kept entries of all lines, as they came."""
        with self._lock:
            kept = [each for line in self._lines.values() for each in line.entries]
        return tuple(entry for _, entry in sorted(kept, key=itemgetter(0)))

    def text(self) -> str:
        """The trace as text, one entry a line; the first lines say how many were dropped."""
        head = [
            f"# {count} earlier entries of {name} were forgotten" for name, count in self.dropped.items()
        ]
        return "".join(f"{line}\n" for line in (*head, *self.entries()))


class _LineTrace:
    """The latest entries of one line, each with its number among all."""

    def __init__(self, capacity: int) -> None:
        self.dropped = 0
        self.entries: deque[tuple[int, TraceEntry]] = deque()
        self._capacity = capacity
        self._size = 0

    def add(self, number: int, entry: TraceEntry) -> None:
        self.entries.append((number, entry))
        self._size += ENTRY_BYTES + len(entry.data)
        while self._size > self._capacity:
            self._size -= ENTRY_BYTES + len(self.entries.popleft()[1].data)
            self.dropped += 1


def read_trace(text: str) -> tuple[TraceEntry, ...]:
    """The entries of a trace from its text, the inverse of :meth:`WireTrace.text`.

    Raises:
        FileError: a line is no entry.
    """
    entries = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):
            continue
        if (match := ENTRY.fullmatch(line)) is None:
            problem = f"line {number} is no entry of a wire trace: {line[:60]!r}"
            raise FileError(problem, action="Take it from a run's `wire`")
        data = bytes.fromhex(match["bytes"])
        entries.append(
            TraceEntry(float(match["time_s"]), match["line"], TrafficDirection(match["direction"]), data)
        )
    return tuple(entries)
