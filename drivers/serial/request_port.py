"""A line that is asked: what all such lines have in common, and the frames among received bytes."""

import re
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from drivers.errors import PortLost
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection

LINE_ENDS = b"\r\n\0\x11\x13"
"""Ends of lines; NUL bytes, which lines put before a frame when they are switched; and XON and XOFF."""
LINE_END = re.compile(rb"[\r\n\0]+")
LOG_LENGTH = 256
FRAME_LIMIT = 256


def cut_frame(received: bytes, request: bytes, terminator: bytes) -> tuple[bytes, bytes] | None:
    """The first complete frame in ``received``, ``terminator`` included, and the bytes after it.

    Line ends and NUL bytes before the frame are removed, since some devices send more than documented, and
    so is the echo of ``request`` that some devices send, with any line end. None as long as no frame is
    complete.
    """
    body = received.lstrip(LINE_ENDS).removeprefix(request).lstrip(LINE_ENDS)
    words = request.rstrip(LINE_ENDS)
    if words and LINE_END.match(body, len(words)):
        body = body.removeprefix(words).lstrip(LINE_ENDS)
    head, end, rest = body.partition(terminator)
    return (head + end, rest) if end else None


def is_copies(surplus: bytes, frame: bytes) -> bool:
    """Whether ``surplus`` is nothing, or ``frame`` once more or several times."""
    return not surplus.replace(frame, b"").strip(LINE_ENDS) if frame else not surplus.strip(LINE_ENDS)


@dataclass(frozen=True, slots=True)
class StreamedFrame:
    """A line of text without its end; ``number`` counts from 1.

    Its first byte came after ``began_after_s``, s of the port's clock.
    """

    number: int
    began_after_s: float
    data: bytes


class FrameLog:
    """The latest frames. Bytes that nobody read for a while are as old as the last look at the line.

    A frame ends with ``end``, by default any line end; one that comes twice at once is one: a copy confirms
    nothing. ``count`` is how many there were, ``latest`` the last bytes, ``pieces`` how often some came.
    """

    def __init__(self, end: bytes | None = None) -> None:
        self.count = 0
        self._end = LINE_END if end is None else re.compile(re.escape(end) + rb"[\r\n\0]*")
        self._frames: deque[StreamedFrame] = deque(maxlen=LOG_LENGTH)
        self._begun = b""
        self._begun_after_s = 0.0
        self.latest, self.pieces = b"", 0

    def add(self, data: bytes, came_after_s: float) -> None:
        """Take bytes that were read together, all of which came after a time."""
        if data:
            self.latest, self.pieces = (self.latest + data)[-FRAME_LIMIT:], self.pieces + 1
        if not self._begun:
            self._begun_after_s = came_after_s
        *lines, begun = self._end.split(self._begun + data)
        before = b""
        for line in lines:
            if line and line != before:
                self.count += 1
                self._frames.append(StreamedFrame(self.count, self._begun_after_s, line))
            before = line or before
            self._begun_after_s = came_after_s
        self._begun = begun[-FRAME_LIMIT:]

    def after(self, number: int) -> tuple[StreamedFrame, ...]:
        """The frames after one, oldest first."""
        return tuple(frame for frame in tuple(self._frames) if frame.number > number)


WORST_LATENCY_S = 2.0
"""Longest time, s, after which an answer may still come to a request that has timed out."""


class NoAnswer(Exception):
    """No complete frame in time; ``received`` is what came, ``beside_echo`` without the request's echo.

    ``is_echoed``: the request came back. Never shown to users.
    """

    def __init__(self, received: bytes, request: bytes) -> None:
        self.received = received
        self.beside_echo = received.replace(request, b"") if request else received
        self.is_echoed = self.beside_echo != received
        super().__init__(received)


@dataclass(eq=False)
class RequestPort(ABC):
    """A line with requests and answers, used from one thread.

    Attributes:
        url: the line, as the cell file names it.
        settings: of the line, from the cell file and the protocol; ``settle_s`` is how long a device may
            restart and hear nothing after the line was opened.
        closing: set by another thread to interrupt every wait.
        recorder: gets all bytes.
        worst_latency_s: how long nothing is asked after a time-out, s.
        subject: the device that messages name.
        unsolicited: bytes that came without a request or too late; the latest ones only.
        open_count: how often the line has been opened.
        surplus_count: how often bytes had come before a request, copies included: the answer to the one
            before may have been such bytes.
    """

    url: str
    settings: Mapping[str, object]
    closing: threading.Event
    recorder: TraceRecorder | None = None
    worst_latency_s: float = WORST_LATENCY_S
    open_count: int = 0
    surplus_count: int = 0
    _must_clear: bool = False
    _has_answered: bool = False

    def __post_init__(self) -> None:
        self.subject = f"port {self.url}"
        self.unsolicited: deque[bytes] = deque(maxlen=64)
        self._settings: dict[str, Any] = dict(self.settings)
        self._settle_s = float(self._settings.pop("settle_s", 0.0))
        self._settled_s = self._asked_at = -inf
        self._wire = LineRecord(self.url, self.recorder)

    @abstractmethod
    def open(self) -> int:
        """Open the line unless it is open and usable; how often it has been opened.

        Raises:
            UsageError: the library that opens it is not installed.
            PortLost: the line is absent, in use, or cannot be opened.
            FileError: the URL or a setting is refused.
        """

    def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; the first complete frame after it, up to ``terminator``.

        Opening a port restarts many a microcontroller (by DTR), and what it is sent meanwhile is lost. So
        what was asked within ``settle_s`` after the opening is asked again, until something is answered.

        Raises:
            NoAnswer: no complete frame within ``timeout_s``.
            DeviceError: the line is not open, was lost or is being closed, or does not become silent.
        """
        while True:
            try:
                frame = self._exchange_once(request, terminator, timeout_s)
            except NoAnswer:
                if self._has_answered or self._asked_at >= self._settled_s:
                    raise
            else:
                self._has_answered = True
                return frame

    @abstractmethod
    def _exchange_once(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Ask once; raises as ``exchange``."""

    def now(self) -> float:
        """The time, s, by which frames are dated."""
        return time.monotonic()

    def settles_for_s(self) -> float:
        """How long, s, the device may still be restarting because the line was opened."""
        return max(0.0, self._settled_s - self.now())

    def _opened(self) -> None:
        """The line was opened now."""
        self.open_count += 1
        self._has_answered = False
        self._settled_s = self.now() + self._settle_s

    @abstractmethod
    def close(self) -> None:
        """Close the line; closing twice is harmless."""

    def require_silence(self) -> None:
        """Drop what is on its way before the next request."""
        self._must_clear = True

    def require_not_closed(self) -> None:
        """Raise if this program has closed the line or is closing it."""
        if self.closing.is_set():
            raise PortLost(f"port {self.url} is closed", subject=self.subject)

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if direction is TrafficDirection.SENT:
            self._asked_at = self.now()
        self._wire.add(direction, data)
