"""What a dial indicator shows, as its answer says it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

INCH_DECIMALS = 5  # no instrument resolves 10 nm, so this many decimals are inches


class Unit(StrEnum):
    """The unit an instrument is switched to."""

    MM = "mm"
    INCH = "inch"


@dataclass(frozen=True, slots=True)
class Shown:
    """A number on the display: in ``unit``, or in one that the answer does not name."""

    value: float
    decimals: int
    unit: Unit | None
    text: str

    @classmethod
    def of(cls, sign: bytes, digits: bytes, frame: bytes, unit: Unit | None = None) -> Shown:
        """From an answer's sign, ``+``, ``-`` or blank, and its digits with one decimal point."""
        number = digits.strip().decode("ascii")
        value = float(number)
        decimals = len(number.partition(".")[2])
        return cls(-value if sign == b"-" else value, decimals, unit, frame.decode("ascii").strip())

    @property
    def apparent_unit(self) -> Unit:
        """The unit named in the answer, else the one that its decimals give away."""
        guess = Unit.INCH if self.decimals >= INCH_DECIMALS else Unit.MM
        return self.unit or guess
