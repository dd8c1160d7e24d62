"""Faults of a simulated gauge and its line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from random import Random

from drivers.simulated.gauges.device import Indicator

DIGITS = b"0123456789"
DATA_BITS = 7


class InjectedGaugeFault(StrEnum):
    """A fault of the line, the instrument or the plug."""

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
    """Set or clear a fault of an instrument; false if it is a fault of the line."""
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
class _ActiveFault:
    """An active fault: for a number of answers, or until cleared."""

    answers: int | None
    seconds: float

    def applies(self) -> bool:
        if self.answers is None:
            return True
        self.answers -= 1
        return self.answers >= 0


class WireFaults:
    """Faults that affect answers on the line."""

    def __init__(self, seed: int = 0) -> None:
        self._random = Random(seed)  # noqa: S311 - a simulation
        self._active: dict[InjectedGaugeFault, _ActiveFault] = {}

    def inject(self, fault: InjectedGaugeFault, *, answers: int | None, seconds: float) -> None:
        """Activate ``fault`` for the next ``answers``, or all of them; ``seconds`` is the delay."""
        self._active[fault] = _ActiveFault(answers, seconds)

    def clear(self, fault: InjectedGaugeFault) -> None:
        """Clear ``fault``."""
        self._active.pop(fault, None)

    def apply(self, answer: bytes) -> tuple[bytes, float]:
        """The answer as changed by the active faults, and its delay, s."""
        delay = 0.0
        for fault, active in tuple(self._active.items()):
            if not active.applies():
                self.clear(fault)
            elif fault is InjectedGaugeFault.SILENT:
                answer = b""
            elif fault is InjectedGaugeFault.LATE:
                delay = active.seconds
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
