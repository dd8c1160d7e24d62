"""The encoders' CAN bus: opened, read by one thread, and every wait on it bounded."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import can
import canopen

from drivers.encoders.errors import BusError
from drivers.wire_trace import TraceEntry, TraceRecorder, TrafficDirection

SLICE_S = 0.03
"""Longest uninterrupted wait."""

SEND_TIMEOUT_S = 0.2
"""Longest wait for an interface to take a frame."""
JOIN_TIMEOUT_S = 1.0
"""Longest wait for the receiving thread, should an interface ignore the time it is given."""

# Failures leave this package as errors; without a handler canopen would also print them.
logging.getLogger("canopen").addHandler(logging.NullHandler())


class EncoderBus:
    """A CANopen network whose frames one thread receives and hands to the subscribers.

    Subscribers run on that thread with ``news`` held, and notify it when they have something
    that a waiting thread should look at. ``guard`` is called at every look; it raises when
    waiting on would be in vain. ``trace`` gets every frame as candump writes it: ``181#00C40900``.

    Raises:
        BusError: The bus cannot be opened.
    """

    def __init__(
        self, settings: Mapping[str, Any], interrupted: threading.Event, trace: TraceRecorder | None = None
    ) -> None:
        self.name = _name_of(settings)
        self.condition = threading.Condition()
        self.health_check: Callable[[], None] = lambda: None
        self._interrupted = interrupted
        self._trace = trace
        self._failure: Exception | None = None
        self._closing = threading.Event()
        self._bus = self._connect(settings)
        self.network = _Network(self._bus, self._send)
        self._receiver = threading.Thread(target=self._receive, name=f"{self.name} in", daemon=True)
        self._receiver.start()

    def check(self) -> None:
        """Raise if the bus has died, the job was interrupted, or the guard objects.

        Raises:
            DeviceError: What is wrong.
        """
        with self.condition:
            if self._failure is not None:
                raise self._error("has died", self._failure) from self._failure
            if self._interrupted.is_set():
                raise BusError("was interrupted", subject=self.name, action="Read again")
            self.health_check()

    def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until ``ready()``; false after ``timeout_s``.

        Raises:
            DeviceError: As :meth:`check`.
        """
        deadline = time.monotonic() + timeout_s
        with self.condition:
            while not ready():
                self.check()
                left = deadline - time.monotonic()
                if left <= 0:
                    return False
                self.condition.wait(min(left, SLICE_S))
        return True

    def listen(self, seconds: float) -> None:
        """Let ``seconds`` pass while frames come in.

        Raises:
            DeviceError: As :meth:`check`.
        """
        self.wait_for(lambda: False, seconds)

    def close(self) -> None:
        """End the receiving thread and let the bus go, dead or alive."""
        self._closing.set()
        self._receiver.join(JOIN_TIMEOUT_S)
        _shut_down(self._bus)
        self._receiver.join(JOIN_TIMEOUT_S)

    def _connect(self, settings: Mapping[str, Any]) -> can.BusABC:
        try:
            return can.Bus(**settings)
        except Exception as error:  # the many interfaces of python-can raise whatever they like
            raise BusError(
                f"cannot be opened: {_in_words(error)}",
                subject=self.name,
                action="Plug the CAN adapter in, or correct `bus` under [encoders] in the cell file",
            ) from error

    def _receive(self) -> None:
        try:
            while not self._closing.is_set():
                message = self._bus.recv(SLICE_S)
                if message is not None and _concerns_canopen(message):
                    self._deliver(message)
        except Exception as error:  # whatever it is, it must reach whoever waits
            with self.condition:
                self._failure = error
                self.condition.notify_all()

    def _deliver(self, message: can.Message) -> None:
        with self.condition:
            self._record(TrafficDirection.RECEIVED, message)
            self.network.notify(message.arbitration_id, message.data, message.timestamp)

    def _send(self, message: can.Message) -> None:
        self._record(TrafficDirection.SENT, message)
        try:
            self._bus.send(message, timeout=SEND_TIMEOUT_S)
        except Exception as error:
            raise self._error("does not take a frame", error) from error

    def _record(self, direction: TrafficDirection, message: can.Message) -> None:
        if self._trace is not None:
            text = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
            self._trace(TraceEntry(time.time(), self.name, direction, text.encode()))

    def _error(self, what: str, cause: Exception) -> BusError:
        return BusError(
            f"{what}: {_in_words(cause)}",
            subject=self.name,
            action="Check the CAN adapter, its cable, supply and termination, then open the encoders "
            "again; the set that was being measured is void",
        )


class _Network(canopen.Network):
    """A canopen network that others receive for, and whose sending is bounded."""

    def __init__(self, bus: can.BusABC, send: Callable[[can.Message], None]) -> None:
        super().__init__(bus)
        self._send = send

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send one frame.

        Raises:
            BusError: The bus does not take it.
        """
        frame = can.Message(
            arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote, is_rx=False
        )
        with self.send_lock:
            self._send(frame)


def _concerns_canopen(message: can.Message) -> bool:
    """Whether it is a data frame of somebody else's with an 11-bit id."""
    return message.is_rx and not (
        message.is_error_frame or message.is_remote_frame or message.is_extended_id
    )


def _name_of(settings: Mapping[str, Any]) -> str:
    words = (settings.get("interface"), settings.get("channel"))
    return " ".join(["encoder bus", *(str(word) for word in words if word is not None)])


def _in_words(error: Exception) -> str:
    """The message, and what is behind it: python-can wraps the errors of what it is built on."""
    behind = "" if error.__cause__ is None else str(error.__cause__)
    return str(error) if behind in str(error) else f"{error} ({behind})"


def _shut_down(bus: can.BusABC) -> None:
    # On a dead line, python-can's slcan stops before it closes its port, and pyserial's socket://
    # before it closes its socket.
    port = getattr(bus, "serialPortOrig", None)
    connection = getattr(port, "_socket", None)
    for part in (bus.shutdown, getattr(port, "close", None), getattr(connection, "close", None)):
        if part is not None:
            with suppress(Exception):
                part()
