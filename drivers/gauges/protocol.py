"""What a gauge protocol defines: the serial line, the display, the settings, and how a search finds it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from enum import StrEnum

from hexacell.errors import DeviceError

TERMINATOR = b"\r"
"""Ends every request, and is the first line end of every answer."""


@dataclass(frozen=True, slots=True)
class LineSettings:
    """A protocol's defaults for the serial port, as pyserial names them.

    The cell file's ``serial`` table overrides them.
    """

    baudrate: int
    bytesize: int = 8
    parity: str = "N"
    stopbits: int = 1
    dtr: bool = True
    rts: bool = True
    exclusive: bool = True

    def __str__(self) -> str:
        return f"{self.baudrate} baud {self.bytesize}{self.parity}{self.stopbits}"


@dataclass(frozen=True, slots=True)
class ProtocolSpec:
    """One protocol: its name in the cell file, its vendors, its line, and a typical answer."""

    protocol: str
    vendors: str
    line: LineSettings
    example: str


@dataclass(frozen=True, slots=True)
class Probe:
    """How a search finds gauges of a protocol on a port of which nothing is known: it opens one.

    Attributes:
        other_baud_rates: of instruments that come set to other rates than the protocol's usual one.
        is_last: asked after all others, because instruments of other protocols mistake its question.
        channel_of: for gauges that send unasked: the channel whose value a frame is, None for other frames.
            The line is then listened to, and nothing is asked.
    """

    other_baud_rates: tuple[int, ...] = ()
    is_last: bool = False
    channel_of: Callable[[bytes], int | None] | None = None


class FrameRejected(Exception):
    """A frame that does not fully match the protocol; the request is repeated. Never shown to users."""

    def __init__(self, frame: bytes) -> None:
        self.frame = frame
        super().__init__(frame)


class ImplausibleValue(FrameRejected):
    """A frame of the protocol whose value cannot be; ``error`` is for the user if it comes again."""

    def __init__(self, frame: bytes, error: DeviceError) -> None:
        self.error = error
        super().__init__(frame)


class Unit(StrEnum):
    """The unit an instrument is set to."""

    MM = "mm"
    INCH = "inch"


@dataclass(frozen=True, slots=True)
class DisplayedValue:
    """A displayed number; ``unit`` is None if the answer does not name it."""

    value: float
    decimals: int
    unit: Unit | None
    text: str

    @classmethod
    def of(cls, sign: bytes, digits: bytes, frame: bytes, unit: Unit | None = None) -> DisplayedValue:
        """From the sign (``+``, ``-`` or blank) and the digits of an answer."""
        number = digits.strip().decode("ascii")
        value = float(number)
        decimals = len(number.partition(".")[2])
        return cls(-value if sign == b"-" else value, decimals, unit, frame.decode("ascii").strip())


@dataclass(frozen=True, slots=True)
class GaugeState:
    """The settings that make readings wrong, or the zero void if they change.

    None where the protocol or the instrument does not report a setting.
    """

    identification: str | None = None
    unit: Unit | None = None
    decimals: int | None = None
    mode: str | None = None
    hold: bool | None = None
    reversed: bool | None = None
    preset: str | None = None
    scaling: bool | None = None
    battery_low: bool | None = field(default=None, compare=False)

    def changes_since(self, before: GaugeState) -> tuple[str, ...]:
        """Each setting that differs from the known one ``before``, as text."""
        found = []
        for setting in fields(self):
            old, new = getattr(before, setting.name), getattr(self, setting.name)
            if setting.compare and old is not None and new is not None and old != new:
                found.append(f"{setting.name} {old} -> {new}")
        return tuple(found)
