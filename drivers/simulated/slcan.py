"""A CAN adapter that speaks slcan, the ASCII protocol of LAWICEL and CANable class devices.

It makes a ``virtual`` CAN bus of this process available to other processes. Commands end with CR and are
answered with CR, or BEL for an error; frames are ``t`` (11-bit id) and ``T`` (29-bit): id in
hexadecimal, number of bytes, bytes. No device here knows remote requests.
"""

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
_FRAME = re.compile(r"(?:t([0-7][0-9A-Fa-f]{2})|T([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)")
_SET_UP = re.compile(r"S[0-9]|s[0-9A-Fa-f]{4}|Y[0-9]?|Z[01]|")
_INFORMATION = {"V": "V1013", "v": "v1013", "N": "NHX01", "F": "F00"}


def encode_frame(message: can.Message) -> bytes:
    """A frame in slcan format, with its CR."""
    number = message.arbitration_id
    head = f"T{number:08X}" if message.is_extended_id else f"t{number:03X}"
    return f"{head}{message.dlc:d}{bytes(message.data).hex().upper()}\r".encode()


def decode_frame(command: str) -> can.Message | None:
    """The frame in a command (without CR); None if the command is no valid frame."""
    match = _FRAME.fullmatch(command)
    if match is None or len(match[4]) != 2 * int(match[3]):
        return None
    identifier, is_extended = int(match[1] or match[2], 16), match[2] is not None
    return can.Message(arbitration_id=identifier, is_extended_id=is_extended, data=bytes.fromhex(match[4]))


class SlcanAdapter:
    """The adapter's command interpreter; it transmits frames only while its channel ``is_open``."""

    def __init__(self, transmit: Callable[[can.Message], None]) -> None:
        self.is_open = False
        self._may_transmit = False
        self._transmit = transmit

    def answer(self, command: str) -> bytes:
        """Execute one command (without CR) and return the answer."""
        if command in ("O", "L"):
            self.is_open, self._may_transmit = True, command == "O"
            return _OK
        if command == "C":
            self.is_open = False
            return _OK
        if command in _INFORMATION:
            return _INFORMATION[command].encode() + _OK
        if _SET_UP.fullmatch(command):
            return _ERROR if self.is_open and command else _OK
        message = decode_frame(command)
        if message is None or not (self.is_open and self._may_transmit):
            return _ERROR
        self._transmit(message)
        return (b"Z" if message.is_extended_id else b"z") + _OK


class SlcanServer(Closeable):
    """An adapter between a virtual CAN channel and a serial line, with one thread for each direction."""

    def __init__(self, channel: str, line: SerialLine) -> None:
        self.bus_settings: dict[str, Any] = {
            "interface": "slcan",
            "channel": line.url,
            "bitrate": BITRATE,
            "sleep_after_open": 0,
            "timeout": CLIENT_TIMEOUT_S,
        }
        self._line = line
        self._bus = can.Bus(channel, interface="virtual")
        self._adapter = SlcanAdapter(self._bus.send)
        self._writing = threading.Lock()
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=target, name=f"slcan {line.url}", daemon=True)
            for target in (self._receive_commands, self._send_frames)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        if self._closing.is_set():
            return
        self._closing.set()
        for thread in self._threads:
            thread.join()
        self._line.close()
        self._bus.shutdown()

    def _receive_commands(self) -> None:
        client, pending = 0, b""
        while not self._closing.is_set():
            ready, _, _ = select.select(self._line.descriptors(), [], [], SLICE_S)
            data = self._line.receive(ready)
            if self._line.connections != client:  # a new client finds the channel closed
                client, self._adapter.is_open, pending = self._line.connections, False, b""
            *commands, pending = (pending + data).split(b"\r")
            pending = pending[-MAX_COMMAND_BYTES:]
            for command in commands:
                self._write(self._adapter.answer(command.decode("ascii", "replace")))

    def _send_frames(self) -> None:
        while not self._closing.is_set():
            message = self._bus.recv(SLICE_S)
            if message is not None and not message.is_remote_frame and self._adapter.is_open:
                self._write(encode_frame(message))

    def _write(self, data: bytes) -> None:
        with self._writing:
            self._line.send(data, SEND_TIMEOUT_S)
