"""What can be made to go wrong with a simulated gauge and its line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from random import Random

from drivers.simulated.gauges.indicator import Indicator

DIGITS = b"0123456789"
DATA_BITS = 7


class InjectedGaugeFault(StrEnum):
    """A fault, on the line, of the instrument, or of the plug."""

    SILENT = "silent"
    LATE = "late"
    GARBLED_DIGIT = "garbled-digit"
    GARBLED_BIT = "garbled-bit"
    INCH = "inch"
    HOLD = "hold"
    REVERSED = "reversed"
    BATTERY_LOW = "battery-low"
    AUTO_OFF = "auto-off"
    UNPLUGGED = "unplugged"
    AT_END = "at-end"
    PUSHED = "pushed"
    FROZEN = "frozen"


def apply_fault(indicator: Indicator, fault: InjectedGaugeFault, *, on: bool) -> bool:
    """Set an instrument's fault or take it away; false if ``fault`` is none of an instrument."""
    match fault:
        case InjectedGaugeFault.INCH:
            indicator.inch = on
        case InjectedGaugeFault.REVERSED:
            indicator.reversed = on
        case InjectedGaugeFault.BATTERY_LOW:
            indicator.battery_low = on
        case InjectedGaugeFault.AT_END:
            indicator.at_end = on
        case InjectedGaugeFault.PUSHED:
            indicator.push(on=on)
        case InjectedGaugeFault.FROZEN:
            indicator.jam(on=on)
        case InjectedGaugeFault.HOLD:
            (indicator.hold if on else indicator.release)()
        case InjectedGaugeFault.AUTO_OFF:
            (indicator.switch_off if on else indicator.switch_on)()
        case _:
            return False
    return True


@dataclass(slots=True)
class _Strike:
    """How long a fault lasts: a number of answers, or for ever."""

    answers: int | None
    seconds: float

    def strikes(self) -> bool:
        if self.answers is None:
            return True
        self.answers -= 1
        return self.answers >= 0


class WireFaults:
    """What happens to answers between the device and the line."""

    def __init__(self, seed: int = 0) -> None:
        self._random = Random(seed)  # noqa: S311 - a simulation
        self._active: dict[InjectedGaugeFault, _Strike] = {}

    def inject(self, fault: InjectedGaugeFault, *, answers: int | None, seconds: float) -> None:
        """Let ``fault`` strike the next ``answers``, or all of them; ``seconds`` is how late."""
        self._active[fault] = _Strike(answers, seconds)

    def clear(self, fault: InjectedGaugeFault) -> None:
        """Let it strike no more."""
        self._active.pop(fault, None)

    def apply(self, answer: bytes) -> tuple[bytes, float]:
        """What becomes of ``answer``: the bytes that leave, and how many seconds late."""
        delay = 0.0
        for fault, strike in tuple(self._active.items()):
            if not strike.strikes():
                self.clear(fault)
            elif fault is InjectedGaugeFault.SILENT:
                answer = b""
            elif fault is InjectedGaugeFault.LATE:
                delay = strike.seconds
            elif fault is InjectedGaugeFault.GARBLED_DIGIT:
                answer = flip_digit(answer, self._random)
            else:
                answer = flip_bit(answer, self._random)
        return answer, delay


def flip_digit(data: bytes, random: Random) -> bytes:
    """``data`` with one of its digits replaced by another one."""
    places = [place for place, byte in enumerate(data) if byte in DIGITS]
    if not places:
        return data
    place = random.choice(places)
    return _replaced(data, place, random.choice(DIGITS.replace(data[place : place + 1], b"")))


def flip_bit(data: bytes, random: Random) -> bytes:
    """``data`` with one bit of one byte flipped, bit 7 left alone."""
    if not data:
        return data
    place = random.randrange(len(data))
    return _replaced(data, place, data[place] ^ 1 << random.randrange(DATA_BITS))


def _replaced(data: bytes, place: int, byte: int) -> bytes:
    return data[:place] + bytes([byte]) + data[place + 1 :]
