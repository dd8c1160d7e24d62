"""What a shared port needs of the line behind it: a serial port, or one that another library opens."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Protocol

from drivers.errors import PortLost
from drivers.wire_trace import TraceEntry, TraceRecorder, TrafficDirection


class RequestPort(Protocol):
    """A line that is asked, used from one thread, as :class:`drivers.serial.port.SerialPort`."""

    subject: str
    unsolicited: deque[bytes]
    open_count: int
    surplus_count: int

    def open(self) -> int:
        """Open it unless it is open and usable; how often it has been opened."""
        ...

    def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; the first complete frame after it, or ``NoAnswer``."""
        ...

    def require_silence(self) -> None:
        """Let nothing that is on its way be the next answer."""
        ...

    def require_not_closed(self) -> None:
        """Raise if this program has closed the line or is closing it."""
        ...

    def close(self) -> None:
        """Close it; twice is harmless."""
        ...


class LibraryPort:
    """What lines have in common that a library opens: their counters, closing, silence and trace.

    ``settings`` are those of the cell file. After a time-out nothing is asked for ``worst_latency_s``.
    """

    def __init__(
        self,
        url: str,
        settings: Mapping[str, object],
        closing: threading.Event,
        recorder: TraceRecorder | None = None,
        worst_latency_s: float = 2.0,
    ) -> None:
        self.url = url
        self.subject = f"port {url}"
        self.unsolicited: deque[bytes] = deque(maxlen=64)
        self.open_count = 0
        self.surplus_count = 0
        self._settings = settings
        self._closing = closing
        self._recorder = recorder
        self._worst_latency_s = worst_latency_s
        self._must_clear = False

    def require_silence(self) -> None:
        """Drop what comes before the next request."""
        self._must_clear = True

    def require_not_closed(self) -> None:
        """Raise if this program has closed the line or is closing it."""
        if self._closing.is_set():
            raise PortLost(f"port {self.url} is closed", subject=self.subject)

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if data and self._recorder is not None:
            self._recorder(TraceEntry.now(self.url, direction, data))


class PortFactory(Protocol):
    """Makes the port of a URL, not opened yet."""

    def __call__(
        self,
        url: str,
        settings: Mapping[str, object],
        closing: threading.Event,
        recorder: TraceRecorder | None,
        worst_latency_s: float,
        /,
    ) -> RequestPort:
        """The port."""
        ...
