"""A line that is asked: what serial ports, and lines that another library opens, have in common."""

import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping

from drivers.errors import PortLost
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection

WORST_LATENCY_S = 2.0
"""Longest time, s, after which an answer may still come to a request that has timed out."""


class NoAnswer(Exception):
    """No complete frame in time; ``received`` is what came, the echo of the request included.

    Never shown to users.
    """

    def __init__(self, received: bytes) -> None:
        self.received = received
        super().__init__(received)


class RequestPort(ABC):
    """A line with requests and answers, used from one thread.

    Args:
        url: the line, as the cell file names it.
        settings: of the line, from the cell file and the protocol.
        closing: set by another thread to interrupt every wait.
        recorder: gets all bytes.
        worst_latency_s: how long nothing is asked after a time-out, s.

    Attributes:
        subject: the device that messages name.
        unsolicited: bytes that came without a request or too late; the latest ones only.
        open_count: how often the line has been opened.
        surplus_count: how often bytes had come before a request, copies included: the answer to the one
            before may have been such bytes.
    """

    def __init__(
        self,
        url: str,
        settings: Mapping[str, object],
        closing: threading.Event,
        recorder: TraceRecorder | None = None,
        worst_latency_s: float = WORST_LATENCY_S,
    ) -> None:
        self.url = url
        self.subject = f"port {url}"
        self.unsolicited: deque[bytes] = deque(maxlen=64)
        self.open_count = 0
        self.surplus_count = 0
        self._settings = dict(settings)
        self._closing = closing
        self._wire = LineRecord(url, recorder)
        self._worst_latency_s = worst_latency_s
        self._must_clear = False

    @abstractmethod
    def open(self) -> int:
        """Open the line unless it is open and usable; how often it has been opened.

        Raises:
            UsageError: the library that opens it is not installed.
            PortLost: the line is absent, in use, or cannot be opened.
            FileError: the URL or a setting is refused.
        """

    @abstractmethod
    def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; the first complete frame after it, up to ``terminator``.

        Raises:
            NoAnswer: no complete frame within ``timeout_s``.
            DeviceError: the line is not open, was lost or is being closed, or does not become silent.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the line; closing twice is harmless."""

    def require_silence(self) -> None:
        """Drop what is on its way before the next request."""
        self._must_clear = True

    def require_not_closed(self) -> None:
        """Raise if this program has closed the line or is closing it."""
        if self._closing.is_set():
            raise PortLost(f"port {self.url} is closed", subject=self.subject)

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        self._wire.add(direction, data)
