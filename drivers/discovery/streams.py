"""What comes on a serial line that nobody asked: only listening, for a bounded time."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import closing, suppress

from drivers.gauges.uwave import UwaveGauge, channel_of
from drivers.serial.port import SerialPort
from hexacell.errors import HexacellError

LISTEN_S = 1.0
NUMBER = re.compile(rb"[ -~]*\d\.\d[ -~]*")


def uwave_channels(port: str) -> tuple[int, ...]:
    """The channels whose values come on a port, as from a U-WAVE receiver."""
    channels = (channel_of(frame) for frame in _heard(port, UwaveGauge.spec.line.baudrate))
    return tuple(sorted({channel for channel in channels if channel is not None}))


def a_number(port: str, baudrate: int) -> str:
    """A line with a number that comes on a port; empty if none does."""
    numbers = (frame for frame in _heard(port, baudrate) if NUMBER.fullmatch(frame))
    return next(numbers, b"").decode("ascii")


def _heard(port: str, baudrate: int) -> Iterator[bytes]:
    """Whole lines: the first may be part of one."""
    line = SerialPort(port, {"baudrate": baudrate}, threading.Event())
    with closing(line), suppress(HexacellError):
        line.open()
        end_s = line.now() + LISTEN_S
        while line.now() < end_s:
            line.listen()
        yield from (frame.data for frame in line.log.after(1))
