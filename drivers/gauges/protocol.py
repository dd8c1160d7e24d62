"""What a gauge protocol defines: the serial line, the display, the settings, and how a search finds it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from decimal import Decimal
from enum import StrEnum

from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError


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
    """One protocol: its name in the cell file, its vendors, its line, and a typical answer.

    ``inch_decimals`` are those of a display set to inches, where the makers' manuals say so, and no answer
    names the unit. Decimals tell nothing by themselves: firmware sends mm with as many as it likes.
    """

    protocol: str
    vendors: str
    line: LineSettings
    example: str
    inch_decimals: int | None = None


@dataclass(frozen=True, slots=True)
class Probe:
    """How a search finds gauges of a protocol on a port of which nothing is known: it opens one.

    Attributes:
        other_baud_rates: of instruments that come set to other rates than the protocol's usual one.
        restarts: whether devices of this protocol may restart because the port is opened.
        is_last: asked after all others, because instruments of other protocols mistake its question.
        channel_of: for gauges that send unasked: the channel whose value a frame is, None for other frames.
            The line is then listened to, and nothing is asked.
    """

    other_baud_rates: tuple[int, ...] = ()
    restarts: bool = False
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
    def of(cls, sign: bytes, digits: bytes, frame: bytes, unit: Unit | None = None) -> "DisplayedValue":
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

    def changes_since(self, before: "GaugeState") -> tuple[str, ...]:
        """Each setting that differs from the known one ``before``, as text."""
        found = []
        for setting in fields(self):
            old, new = getattr(before, setting.name), getattr(self, setting.name)
            if setting.compare and old is not None and new is not None and old != new:
                found.append(f"{setting.name} {old} -> {new}")
        return tuple(found)


LARGEST_MM = 1e6
"""No instrument shows this: numbers beyond it, infinite ones and what is no number mean no value."""

TRAVEL_MARGIN = 1.1
"""Instruments travel a little farther than they are sold for."""

AGREEMENT_MM = 0.05
"""Largest difference of readings that agree, mm, where nothing is known of the gauge."""

ROUNDING_MM = 1e-9

ALIKE_DIGITS, ALIKE_SHARE = 2.5, 0.1
"""Readings are alike within so many of their last digits, or this share of what may differ at all."""

MIDDLE_OF = 3


def decimals_of(resolution_mm: float) -> int:
    """The decimals of a display in mm with this resolution: 3 for 0.001 and for 0.005."""
    return max(0, -int(Decimal(str(resolution_mm)).normalize().as_tuple().exponent))


class DisplayHistory:
    """What one gauge has shown: every value must fit to the others.

    The number of decimals holds from the first opening on: where no answer names the unit, a change of it
    shows that of the unit. The values hold from one opening to the next.
    """

    def __init__(self, settings: GaugeSettings) -> None:
        zeros = 1.0 if settings.middle_mm is not None else 2.0  # its zero key may be pressed at either end
        self._span_mm = TRAVEL_MARGIN * zeros * settings.travel_mm
        self._travel_mm = settings.travel_mm
        self._stated = settings.resolution_mm
        self._decimals: int | None = None
        self.agreement_mm = AGREEMENT_MM if settings.agreement_mm is None else settings.agreement_mm
        self._range: tuple[float, float] | None = None

    def agreed(self, readings: Sequence[DisplayedValue]) -> DisplayedValue | None:
        """What readings in a row agree on; None if the latest do not.

        Two that differ by hardly more than the last digits are enough. Where they differ by more, one may
        be damaged: a bit of the hundredths is 0.04 mm, and two such readings of five would outlast the
        trimmed mean of a window. Then the middle one of three counts.
        """
        *_, last = readings
        before = readings[-3:-1]
        if not before or not self._differ_by_at_most(self.agreement_mm, before[-1], last):
            return None
        alike_mm = max(ALIKE_DIGITS * 10.0**-last.decimals, ALIKE_SHARE * self.agreement_mm)
        if self._differ_by_at_most(alike_mm, before[-1], last):
            return last
        if len(before) < MIDDLE_OF - 1 or not self._differ_by_at_most(self.agreement_mm, *before, last):
            return None
        return sorted((*before, last), key=lambda one: one.value)[1]

    @staticmethod
    def _differ_by_at_most(limit_mm: float, *readings: DisplayedValue) -> bool:
        values = [one.value for one in readings]
        return max(values) - min(values) <= limit_mm + ROUNDING_MM

    def begin(self) -> None:
        """The gauge was opened: its zero may be another one."""
        self._range = None

    def is_inch(self, shown: DisplayedValue, set_to: Unit | None, inch_decimals: int | None) -> bool:
        """Whether a value is in inches.

        What the answer names decides, then what the instrument says it is set to, or the stated resolution,
        while the decimals are as before. Only where nothing else tells the unit, the decimals do that
        the protocol has in inches; else the gauge trial decides.
        """
        if shown.unit is not None:
            return shown.unit is Unit.INCH
        is_known = set_to is Unit.MM or self._stated is not None
        if is_known and self._has_its_decimals(shown):
            return False
        return shown.decimals == inch_decimals

    def other_decimals(self, shown: DisplayedValue) -> str | None:
        """Why a value has another unit or resolution, in words; None if it has not."""
        if self._has_its_decimals(shown):
            return None
        if self._stated is None:
            before = f"where it showed {self._decimals} when it was first opened"
        else:
            before = f"and its resolution of {self._stated:g} mm has {decimals_of(self._stated)}"
        return f"shows {shown.decimals} decimals ({shown.text}), {before}"

    def _has_its_decimals(self, shown: DisplayedValue) -> bool:
        """Whether a value has as many decimals as before, and zeros alone beyond its stated resolution."""
        if self._decimals not in {None, shown.decimals}:
            return False
        if self._stated is None or shown.decimals == (meant := decimals_of(self._stated)):
            return True
        rounded = round(shown.value, meant)
        return shown.decimals > meant and abs(shown.value - rounded) < 0.5 * 10.0**-shown.decimals

    def beyond_travel(self, shown: DisplayedValue) -> str | None:
        """Why a value is farther from the others than the plunger travels, in words; None if it is not."""
        lowest, highest = self._extended(shown)
        if highest - lowest <= self._span_mm:
            return None
        return (
            f"shows {shown.text}, and values {highest - lowest:.3f} mm apart do not fit into its travel of "
            f"{self._travel_mm:g} mm"
        )

    def keep_decimals(self, shown: DisplayedValue) -> None:
        """Hold all values to come to the decimals of this one."""
        self._decimals = shown.decimals

    def add(self, shown: DisplayedValue) -> None:
        """Take a value as one that was shown, as a second reading agreed with it.

        A single one may be damaged, and would make right ones impossible.
        """
        self._range = self._extended(shown)

    def _extended(self, shown: DisplayedValue) -> tuple[float, float]:
        lowest, highest = self._range or (shown.value, shown.value)
        return min(lowest, shown.value), max(highest, shown.value)
