"""A CAN adapter that speaks slcan, the ASCII protocol of LAWICEL and CANable class devices.

It makes a ``virtual`` CAN bus of this process available to other processes. Commands end with CR and are
answered with CR, or BEL for an error. CANopen needs data frames with 11-bit ids only: ``t``, id in
hexadecimal, number of bytes, bytes.
"""

from __future__ import annotations

import re
import select
import threading
from collections.abc import Callable
from typing import Any

import can

from drivers.simulated.serial_line import SerialLine
from drivers.simulated.served_device import Closeable

SLICE_S = 0.02
CLIENT_TIMEOUT_S = 0.05
BITRATE = 500_000
MAX_COMMAND_BYTES = 32
SEND_TIMEOUT_S = 0.2
"""How long a client may leave its buffer full before frames are dropped."""

_OK = b"\r"
_ERROR = b"\a"
_FRAME = re.compile(r"t([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)")
_BIT_RATE = re.compile(r"S[0-9]")


def encode_frame(message: can.Message) -> bytes:
    """A frame in slcan format, with its CR."""
    data = bytes(message.data).hex().upper()
    return f"t{message.arbitration_id:03X}{message.dlc:d}{data}\r".encode()


def decode_frame(command: str) -> can.Message | None:
    """The frame in a command (without CR); none if the command is no valid frame."""
    match = _FRAME.fullmatch(command)
    if match is None or len(match[3]) != 2 * int(match[2]):
        return None
    return can.Message(arbitration_id=int(match[1], 16), data=bytes.fromhex(match[3]), is_extended_id=False)


class SlcanAdapter:
    """The adapter's command interpreter; it transmits frames only while its channel ``is_open``."""

    def __init__(self, transmit: Callable[[can.Message], None]) -> None:
        self.is_open = False
        self._transmit = transmit

    def answer(self, command: str) -> bytes:
        """Execute one command (without CR) and return the answer."""
        if command in ("O", "C"):
            self.is_open = command == "O"
            return _OK
        if _BIT_RATE.fullmatch(command):
            return _ERROR if self.is_open else _OK
        message = decode_frame(command)
        if message is None or not self.is_open:
            return _ERROR
        self._transmit(message)
        return b"z" + _OK


class SlcanServer(Closeable):
    """An adapter between a virtual CAN channel and a serial line, with one thread for each direction."""

    def __init__(self, channel: str, line: SerialLine) -> None:
        self._url = line.url
        self._line = line
        self._bus = can.Bus(channel, interface="virtual")
        self._adapter = SlcanAdapter(self._bus.send)
        self._writing = threading.Lock()
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=target, name=f"slcan {self._url}", daemon=True)
            for target in (self._receive_commands, self._send_frames)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def bus_settings(self) -> dict[str, Any]:
        """The settings for ``can.Bus`` to reach the bus from any process of this machine."""
        return {
            "interface": "slcan",
            "channel": self._url,
            "bitrate": BITRATE,
            "sleep_after_open": 0,
            "timeout": CLIENT_TIMEOUT_S,
        }

    def close(self) -> None:
        """End both threads and release line and bus; closing twice is harmless."""
        if self._closing.is_set():
            return
        self._closing.set()
        for thread in self._threads:
            thread.join()
        self._line.close()
        self._bus.shutdown()

    def _receive_commands(self) -> None:
        pending = b""
        while not self._closing.is_set():
            ready, _, _ = select.select(self._line.descriptors(), [], [], SLICE_S)
            data = self._line.receive(ready)
            *commands, pending = (pending + data).split(b"\r")
            pending = pending[-MAX_COMMAND_BYTES:]
            for command in commands:
                self._write(self._adapter.answer(command.decode("ascii", "replace")))

    def _send_frames(self) -> None:
        while not self._closing.is_set():
            message = self._bus.recv(SLICE_S)
            if message is not None and self._adapter.is_open:
                self._write(encode_frame(message))

    def _write(self, data: bytes) -> None:
        with self._writing:
            self._line.send(data, SEND_TIMEOUT_S)
