"""The CAN bus of the encoders: one receiving thread, and a time limit on every wait."""

import errno
import logging
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import can
import canopen

from drivers.errors import BusError
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection
from hexacell.addresses import require_serial_port
from hexacell.clock import Patience

SLICE_S = 0.03
"""Longest wait without a check whether it was interrupted."""

SEND_TIMEOUT_S = 0.2
"""Longest wait for an interface to accept a frame."""
FULL_S = 0.002
"""Wait while the kernel's queue is full: it holds ten frames, and python-can does not wait (issue 2004)."""
JOIN_TIMEOUT_S = 1.0
"""Longest wait for the receiving thread to end, for interfaces that ignore their time-out."""

ERROR_FRAMES, ERROR_FRAMES_S = 20, 1.0
"""So many error frames within this time are a failure; single ones are repeated by the adapter."""

LINE_STARTS = bytes.maketrans(b"\nzZ", b"\r\r\r")
"""What adapters with slcan send between frames, as line ends: an empty line is no frame."""
NUMBERED_AS_LINUX = frozenset({"socketcan", "gs_usb", "virtual"})
FAULTS = {0x40: "bus off", 0x20: "nobody acknowledges", 0x88: "damaged frames", 0x04: "many errors"}
"""By bits in the identifier of an error frame of these interfaces (linux/can/error.h)."""
NO_FRAME = "what comes from it is no frame"
CHECK_BUS = "Check the CAN adapter, its cable, supply, bit rate and termination"
ADVICE = {
    "(permission|access) denied": "Give this user the right to use it (docs/howto-host.md)",
    "busy|exclusively lock": "End the other program that uses it, or ModemManager (docs/howto-host.md)",
    "network is down": "Switch the CAN interface on (docs/howto-host.md)",
    "multiple access": "Plug the CAN adapter in, and end any other program that reads its port",
    NO_FRAME: "End other programs that read this port; use a USB port of its own",
    "address family": "Load the kernel's modules for CAN: sudo modprobe -a can can_raw",
    "connection refused|timed out|unreachable": "Start the adapter's server, or correct channel in `bus`",
    "cannot import|library|is not defined": "Install its maker's library, or correct interface in `bus`",
    "unknown interface|bitrate|(positional|keyword) argument|specify|ioctl|is a dir": "Correct `bus`",
}
"""What to do, by what is in the message of a failure, of the adapter, of pyserial or of the system."""

# Failures are raised as errors; without a handler canopen would also print them.
logging.getLogger("canopen").addHandler(logging.NullHandler())


class EncoderBus:
    """A CANopen network whose frames one thread receives and passes to the subscribers.

    Subscribers run on that thread with ``condition`` held, and notify it about a change that a waiting
    thread must see. ``accepts`` says which frames they get, by default those of CANopen. ``health_check``
    is called at every wake-up and raises if the wait cannot succeed. ``trace`` gets every frame in the
    format of candump: ``181#00C40900``. Every failure of the bus is a ``BusError``; a wait also raises what
    ``health_check`` does. ``reported`` is what the adapter said of the bus at last.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        interrupted: threading.Event,
        trace: TraceRecorder | None = None,
        accepts: Callable[[can.Message], bool] | None = None,
    ) -> None:
        words = (settings.get("interface"), settings.get("channel"))
        self.name = " ".join(["encoder bus", *(str(word) for word in words if word is not None)])
        self.condition = threading.Condition()
        self.health_check: Callable[[], None] = lambda: None
        self._interrupted = interrupted
        self._wire = LineRecord(self.name, trace)
        self._accepts = accepts or is_canopen
        self.hears = False  # a whole frame of anybody: its bit rate is right
        self._failure: Exception | None = None
        self._error_frames: deque[float] = deque(maxlen=ERROR_FRAMES)
        self.reported, self._numbers_as_linux = "", settings.get("interface") in NUMBERED_AS_LINUX
        self._closing = threading.Event()
        self._bus = self._connect(settings)
        self.network = _Network(self._bus, self._send)
        self._receiver = threading.Thread(target=self._receive, name=f"{self.name} in", daemon=True)
        self._receiver.start()

    def check(self) -> None:
        """Raise if the bus has failed, was interrupted, or the health check fails."""
        with self.condition:
            if self._failure is not None:
                raise self._error("has failed", self._failure) from self._failure
            if self._interrupted.is_set():
                raise BusError("was interrupted", subject=self.name, action="Read again")
            self.health_check()

    def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until ``ready()``; false after ``timeout_s``."""
        with self.condition:
            patience = Patience(timeout_s, SLICE_S, time.monotonic())
            while not ready():
                self.check()
                if (left_s := patience.left_s(time.monotonic())) <= 0:
                    return False
                self.condition.wait(min(left_s, SLICE_S))
        return True

    def listen(self, seconds: float) -> None:
        """Receive frames for ``seconds``."""
        self.wait_for(lambda: False, seconds)

    def close(self) -> None:
        """End the receiving thread and close the bus, even if it has failed."""
        self._closing.set()
        self._receiver.join(JOIN_TIMEOUT_S)
        # After an error, python-can's slcan does not close its port, nor pyserial's socket:// its socket.
        port = getattr(self._bus, "serialPortOrig", None)
        connection = getattr(port, "_socket", None)
        for part in (self._bus.shutdown, getattr(port, "close", None), getattr(connection, "close", None)):
            if part is not None:
                with suppress(Exception):
                    part()
        self._receiver.join(JOIN_TIMEOUT_S)

    def _connect(self, settings: Mapping[str, Any]) -> can.BusABC:
        try:
            require_serial_port(str(settings.get("channel", "")))  # of an adapter with slcan
            return _read_as_lines(can.Bus(**settings))
        except Exception as error:  # the interfaces of python-can raise errors of any class
            action = "Plug the CAN adapter in, or correct `bus` under [encoders] in the cell file"
            action = advice_on(error) or action
            raise BusError(f"cannot be opened: {_text(error)}", subject=self.name, action=action) from error

    def _receive(self) -> None:
        try:
            while not self._closing.is_set():
                try:
                    message = self._bus.recv(SLICE_S)
                except (ValueError, IndexError, can.CanError) as error:  # of slcan: damage on USB
                    if not isinstance(error.__cause__ or error, ValueError | IndexError):
                        raise
                    getattr(self._bus, "flush", bool)()  # it would decode the same bytes again
                    self._count_fault(f"{NO_FRAME} ({error})")
                    continue
                if message is None:
                    continue
                self.hears |= not message.is_error_frame
                if message.is_error_frame:
                    bits = message.arbitration_id if self._numbers_as_linux else 0
                    self._count_fault(", ".join(name for bit, name in FAULTS.items() if bits & bit))
                elif self._accepts(message):
                    with self.condition:
                        self._record(TrafficDirection.RECEIVED, message)
                        self.network.notify(message.arbitration_id, message.data, message.timestamp)
        except Exception as error:  # any error must reach the waiting thread
            with self.condition:
                self._failure = error
                self.condition.notify_all()

    def _count_fault(self, what: str) -> None:
        """Raise if there were too many lately: the receiving thread ends, and the bus has failed."""
        self.reported = f"; the adapter reports: {what}" if what else ""
        self._error_frames.append(time.monotonic())
        is_many = len(self._error_frames) == ERROR_FRAMES
        if is_many and self._error_frames[-1] - self._error_frames[0] <= ERROR_FRAMES_S:
            raise can.CanError(f"{ERROR_FRAMES} error frames within {ERROR_FRAMES_S:g} s{self.reported}")
        if FAULTS[0x40] in what:
            raise can.CanError(f"it gave up after many errors{self.reported}")

    def _send(self, message: can.Message) -> None:
        self._record(TrafficDirection.SENT, message)
        patience = Patience(SEND_TIMEOUT_S, SLICE_S, time.monotonic())
        while True:
            try:
                return self._bus.send(message, timeout=SEND_TIMEOUT_S)
            except Exception as error:
                if self._failure is not None:
                    raise self._error("has failed", self._failure) from self._failure
                is_full = getattr(error, "error_code", None) == errno.ENOBUFS
                if not is_full or patience.left_s(time.monotonic()) <= 0:
                    raise self._error("does not accept a frame", error) from error
            time.sleep(FULL_S)

    def _record(self, direction: TrafficDirection, message: can.Message) -> None:
        if self._wire.is_on:
            text = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
            self._wire.add(direction, text.encode())

    def _error(self, what: str, cause: Exception) -> BusError:
        return BusError(
            f"{what}: {_text(cause)}",
            subject=self.name,
            action=f"{advice_on(cause) or CHECK_BUS}, then try again; the set that was being "
            "measured is void",
        )


class _Network(canopen.Network):
    """A canopen network without a receiving thread of its own, and with a time limit on sending."""

    def __init__(self, bus: can.BusABC, send: Callable[[can.Message], None]) -> None:
        super().__init__(bus)
        self._send = send

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send one frame."""
        frame = can.Message(
            arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote, is_rx=False
        )
        with self.send_lock:
            self._send(frame)


def is_canopen(message: can.Message) -> bool:
    """Whether it is a data frame with an 11-bit id, sent by another participant."""
    return message.is_rx and not (message.is_remote_frame or message.is_extended_id)


def _read_as_lines(bus: can.BusABC) -> can.BusABC:
    """The bus; python-can's slcan drops lines that begin with a line feed, or with a late z or Z."""
    if (port := getattr(bus, "serialPortOrig", None)) is not None:
        read = port.read
        port.read = lambda size=1: read(size).translate(LINE_STARTS)
    return bus


def advice_on(error: BaseException | None) -> str | None:
    """What to do after a failure whose cause its message has; None if that is not known."""
    said = "" if error is None else _text(error)
    return next((ADVICE[words] for words in ADVICE if re.search(words, said, re.IGNORECASE)), None)


def _text(error: BaseException) -> str:
    """The message, and that of its cause: python-can wraps the errors of the libraries it uses."""
    cause = "" if error.__cause__ is None else str(error.__cause__)
    return str(error) if cause in str(error) else f"{error} ({cause})"
