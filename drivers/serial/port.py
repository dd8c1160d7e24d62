"""A serial port with blocking request-response exchanges; all calls come from one thread.

No wait is longer than :data:`SLICE_S` without a check whether the port is to be closed, except the
opening of a network port, which pyserial limits to five seconds.
"""

import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf

import serial

from drivers.serial import opening, request_port
from drivers.serial.received import SHOWN_BYTES, quoted
from drivers.wire_trace import TrafficDirection
from hexacell.clock import Patience
from hexacell.errors import DeviceError

FRAME_GAP_S = 0.1
CHUNK_LIMIT = 4096
SILENCE_ATTEMPTS = 5  # a line may take this many times the required silence to become silent
CAREFUL_EXCHANGES = 20  # after bytes that nobody asked for, so many wait whether a frame was the only one
EXCHANGE_TRIES = 3


class SerialPort(request_port.RequestPort):
    """One serial port: requests and their responses, kept synchronized.

    A late response must never be taken for that of the next request. After a time-out, therefore, the
    next request waits until the line has been silent for ``worst_latency_s``. Bytes that come without
    a request are read and kept in ``unsolicited``, never taken for a response; copies of the last response
    are dropped. Once there were any, a response counts only if nothing else comes with it: a key pressed on
    an instrument, or a multiplexer that sends twice, would put all later responses out of step. ``log`` has
    the frames that came unasked, of a device that sends by itself.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self._parity = opening.in_software(self._settings)
        self._port: serial.Serial | None = None
        self._last_traffic = 0.0
        self._silence_s = 0.0
        self._surplus = self._last_frame = b""
        self._careful = 0
        self.log = request_port.FrameLog(self._settings.pop("frame_end", None))
        self._empty_at = -inf

    def open(self) -> int:
        """Open the port unless it is open and usable; how often it has been opened."""
        if self._port is not None and not self._is_alive(self._port):
            self.close()
        if self._port is None:
            self._port = opening.opened_port(self.url, self._settings, self.subject, self.closing)
            opening.have_terminal_check(self._port, self._settings)
            self._opened()
            self._silence_s, self._surplus, self._last_frame, self._careful = 0.0, b"", b"", 0
            self._empty_at = -inf
        return self.open_count

    def _exchange_once(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """The first complete frame; after ``NoAnswer`` the next request waits for late responses."""
        if self._port is None:
            raise opening.lost_port(self.subject, self.url, "it is not open")
        with self._port_errors():
            for _ in range(EXCHANGE_TRIES):
                self._resynchronise(self._port)
                self._send(self._port, request)
                frame = self._frame(self._port, request, terminator, timeout_s)
                if not self._careful or self._is_alone(self._port, frame):
                    return frame
        raise self._not_silent()

    def listen(self) -> None:
        """Take what comes within one slice of time, unasked, into ``log``.

        Raises:
            DeviceError: The port is not open, was lost, or is being closed.
        """
        if self._port is None:
            raise opening.lost_port(self.subject, self.url, "it is not open")
        with self._port_errors():
            if not self._port.in_waiting:
                self._empty_at = self.now()
            self.log.add(self._read(self._port), self._empty_at)

    def require_silence(self) -> None:
        """Wait for a short silence of the line before the next request."""
        self._silence_s = max(self._silence_s, FRAME_GAP_S)

    def close(self) -> None:
        """Close the port; closing twice is harmless."""
        if self._port is not None:
            opening.close_port(self._port)
            self._port = None

    def _is_alive(self, port: serial.Serial) -> bool:
        """Whether it still exists: it may have been unplugged while it was not used."""
        try:
            if port.in_waiting:  # also true where the other end closed the connection
                self._keep_unsolicited(self._read(port))
        except (OSError, termios.error):
            return False
        return True

    def _resynchronise(self, port: serial.Serial) -> None:
        """Read unsolicited bytes until the line has been silent as long as required."""
        surplus, self._surplus = self._surplus, b""
        self._require_silence_after(surplus)
        longest_s = SILENCE_ATTEMPTS * max(self._silence_s, FRAME_GAP_S)
        patience = Patience(longest_s, opening.SLICE_S, time.monotonic())
        while time.monotonic() - self._last_traffic < self._silence_s or port.in_waiting:
            if patience.left_s(time.monotonic()) < 0.0:
                self._keep_unsolicited(surplus)
                raise self._not_silent()
            surplus += self._read(port)
            self._require_silence_after(surplus)
        if surplus.strip(request_port.LINE_ENDS):
            self.surplus_count += 1
        self._keep_unsolicited(surplus)
        self._silence_s = 0.0

    def _is_alone(self, port: serial.Serial, frame: bytes) -> bool:
        """Whether nothing but copies of ``frame`` comes with it, until the line is silent."""
        surplus, self._surplus = self._surplus, b""
        deadline = time.monotonic() + SILENCE_ATTEMPTS * FRAME_GAP_S
        while time.monotonic() - self._last_traffic < FRAME_GAP_S and time.monotonic() < deadline:
            surplus += self._read(port)
        self._keep_unsolicited(surplus)
        if not surplus.strip(request_port.LINE_ENDS):
            self._careful -= 1
        return request_port.is_copies(surplus, frame)

    def _require_silence_after(self, surplus: bytes) -> None:
        if surplus.strip(request_port.LINE_ENDS):
            self.require_silence()

    def _keep_unsolicited(self, surplus: bytes) -> None:
        if not surplus.strip(request_port.LINE_ENDS):
            return
        self.require_silence()
        self._careful = CAREFUL_EXCHANGES
        if not request_port.is_copies(surplus, self._last_frame):
            self.unsolicited.append(surplus)

    def _frame(self, port: serial.Serial, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        received, patience = b"", Patience(timeout_s, opening.SLICE_S, self._asked_at)
        while len(received) <= request_port.FRAME_LIMIT and patience.left_s(time.monotonic()) > 0.0:
            received += self._read(port)
            if cut := request_port.cut_frame(received, request, terminator):
                self._last_frame, self._surplus = cut
                return self._last_frame
        self._silence_s = self.worst_latency_s
        raise request_port.NoAnswer(received, request)

    def _read(self, port: serial.Serial) -> bytes:
        """The bytes that come within one slice, possibly none."""
        self.require_not_closed()
        data = port.read(1)
        if data:
            while len(data) <= CHUNK_LIMIT and (count := port.in_waiting):
                data += port.read(count)
            self._last_traffic = time.monotonic()
            self._record(TrafficDirection.RECEIVED, data)
        return data if self._parity is None else self._parity.decode(data)

    def _send(self, port: serial.Serial, request: bytes) -> None:
        self.require_not_closed()
        request = request if self._parity is None else self._parity.encode(request)
        self._record(TrafficDirection.SENT, request)
        self._last_traffic = self._asked_at
        opening.sent(port.write, request)

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, termios.error) as error:
            self.close()
            raise opening.lost_port(self.subject, self.url, str(error)) from error

    def _not_silent(self) -> DeviceError:
        latest = b"".join(self.unsolicited)[-SHOWN_BYTES:]
        return DeviceError(
            f"the device on {self.url} keeps sending unasked: {quoted(latest)} came last",
            subject=self.subject,
            action="Switch its continuous output off, or correct port and protocol in the cell file",
        )
