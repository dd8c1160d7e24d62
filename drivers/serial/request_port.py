"""What a shared port needs of the line behind it: a serial port, or an instrument with VISA."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Protocol

from drivers.wire_trace import TraceRecorder


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
