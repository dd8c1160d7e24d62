"""Simulated dial indicators, and the bases of the instruments that are made of them, one protocol a class.

An instrument is announced in the entry point group ``hexacell.simulated_gauges``, under its protocol.
"""

from collections.abc import Callable, Mapping
from math import copysign
from typing import ClassVar

from hexacell.cell.devices import GaugeSettings

MM_PER_INCH = 25.4
PUSH_MM = 6.0
OFF_MIDDLE_MM = 3.8

PlungerPosition = Callable[[], float]
"""The plunger position now, mm from the middle of its travel, with noise.

Called from the thread of the line.
"""


class Indicator:
    """One instrument. Its settings, its power and some faults are attributes.

    Attributes:
        plunger: gives its position.
        held_mm: the value on hold.
        peak_mm: the largest value, while it shows that.
        is_at_end: the plunger is at an end of its travel.
        off_middle_mm: by how much the stem is clamped away from where it belongs.
    """

    def __init__(self, plunger: PlungerPosition, travel_mm: float = 12.5) -> None:
        self.inch = False
        self.reversed = False
        self.battery_low = False
        self.powered = True
        self.held_mm: float | None = None
        self.plunger = plunger
        self._travel_mm = travel_mm
        self._offset_mm = 0.0
        self.is_at_end = False
        self._jammed_mm: float | None = None
        self.peak_mm: float | None = None
        self._pushed_mm = 0.0
        self.off_middle_mm = 0.0

    def shown(self) -> float | None:
        """The number on the display, mm or inch; None with the plunger at an end of its travel."""
        value = self._live_mm() if self.held_mm is None else self.held_mm
        if value is None:
            return None
        if self.peak_mm is not None:
            value = self.peak_mm = max(self.peak_mm, value)
        return value / MM_PER_INCH if self.inch else value

    def set_hold(self, *, on: bool) -> None:
        """Hold the display, without effect at an end of the travel; or end the hold."""
        self.held_mm = self._live_mm() if on else None

    def set_peak(self, *, on: bool) -> None:
        """Show the largest value since then, or the present one again."""
        self.peak_mm = self._live_mm() if on else None

    def set_zeroed(self, *, on: bool) -> None:
        """Press the zero key; what it did stays."""
        if on:
            self._offset_mm -= self._live_mm() or 0.0

    def switch_on(self) -> None:
        """Switch on: no hold, and the zero at the present plunger position."""
        self.powered = True
        self.set_hold(on=False)
        self._offset_mm = 0.0
        self.set_zeroed(on=True)

    def set_frozen(self, *, on: bool) -> None:
        """Jam the plunger at its position, or free it; the instrument still answers."""
        self._jammed_mm = self.plunger() if on else None

    def set_pushed(self, *, on: bool) -> None:
        """Push the plunger farther than a ball on its plate could, or release it."""
        self._pushed_mm = -copysign(PUSH_MM, self.plunger()) if on else 0.0

    def _live_mm(self) -> float | None:
        free = self.plunger() + self.off_middle_mm + self._pushed_mm
        position = free if self._jammed_mm is None else self._jammed_mm
        if self.is_at_end or abs(position) > self._travel_mm / 2:
            return None
        return (-position if self.reversed else position) + self._offset_mm


class Instrument:
    """An indicator, or a multiplexer with several, that answers commands.

    ``indicators`` are by channel, counted from 1; all but a multiplexer have channel 1 only.
    """

    baudrate: ClassVar[int] = 9600
    bits_a_byte: ClassVar[int] = 10  # with start, parity and stop bits
    at_end: ClassVar[bytes] = b""
    """The answer with the plunger at an end of its travel."""
    introduction: ClassVar[bytes] = b""
    """What it sends when it is switched on."""
    command_end: ClassVar[bytes] = b"\r"
    """Ends each command."""
    period_s: ClassVar[float | None] = None
    """How often it sends unasked; None if it waits for a command."""

    has_channels: ClassVar[bool] = False
    """Several gauges share the line, each with its channel."""

    def __init__(self, indicators: Mapping[int, Indicator]) -> None:
        self.indicators = dict(indicators)

    @classmethod
    def shares_line(cls, gauge: GaugeSettings) -> bool:
        """Whether other gauges may be on the line of this one."""
        return cls.has_channels or getattr(gauge.described, "has_channel", False)

    def split(self, received: bytes) -> tuple[list[bytes], bytes]:
        """Whole commands among received bytes, without their ends, and the rest."""
        *commands, rest = received.split(self.command_end)
        return [command.strip(b"\n") for command in commands], rest

    def answer(self, command: bytes) -> bytes:
        """The answer to ``command``, without its end; nothing from those that send by themselves."""
        del command
        return b""

    def unasked(self) -> tuple[bytes, ...]:
        """What it sends each period, of all its indicators that are on."""
        values = (self._value(channel) for channel, one in self.indicators.items() if one.powered)
        return tuple(value for value in values if value)

    @classmethod
    def address(cls, url: str) -> str:
        """What the cell file names as the port of a line at ``url``."""
        return url

    def format_value(self, channel: int, value: float, *, inch: bool) -> bytes:
        """The answer with a value, mm or inch; for instruments whose values say what else they need."""
        raise NotImplementedError

    def _value(self, channel: int) -> bytes:
        indicator = self.indicators[channel]
        shown = indicator.shown()
        return self.at_end if shown is None else self.format_value(channel, shown, inch=indicator.inch)


class SingleIndicator(Instrument):
    """One indicator; silent while it is off."""

    @property
    def indicator(self) -> Indicator:
        return self.indicators[1]

    def answer(self, command: bytes) -> bytes:
        """The value, a setting, or what the protocol answers to a command."""
        return self._reply(command.decode("ascii", "replace")) if self.indicator.powered else b""

    def _reply(self, command: str) -> bytes:
        """The answer while it is on: to any command the value, if the protocol knows no others."""
        del command
        return self._value(1)
