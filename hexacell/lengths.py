"""Lengths for people: in mm with three decimals, or in um where these would show hardly a digit.

Figures that belong together, as an error and its uncertainty, have one unit. Angles are in deg, or in mdeg
where they would be shown as zero. Files and documents for other programs are in mm and deg always.
"""

from dataclasses import dataclass
from math import ceil, floor, log10

MM_PER_METRE = 1000.0

SMALLEST_MM = 0.01
"""Lengths of which the largest is smaller than this are shown in um."""

SMALLEST_DEG = 0.001
"""Angles, likewise in mdeg."""


@dataclass(frozen=True, slots=True)
class ShownUnit:
    """A unit in which sizes are shown: its name, how many of it are one in files, and decimals."""

    name: str
    per_unit: float = 1.0
    decimals: int = 3

    def number(self, size: float, sign: str = "") -> str:
        """A size without the unit."""
        return f"{self.per_unit * size:{sign}.{self.decimals}f}"

    def length(self, size: float, sign: str = "") -> str:
        """A size with the unit."""
        return f"{self.number(size, sign)} {self.name}"

    def limit(self, size: float) -> str:
        """A limit, which has the digits that were stated."""
        return f"{self.per_unit * size:g}"

    @property
    def smallest(self) -> float:
        """Sizes that are smaller would be shown as zero."""
        return float(0.5 * 10.0**-self.decimals / self.per_unit)


MM, UM, DEG, MDEG = ShownUnit("mm"), ShownUnit("um", 1e3, 2), ShownUnit("deg"), ShownUnit("mdeg", 1e3, 2)


def unit_of(*sizes: float | None, unit: str = "mm") -> ShownUnit:
    """The unit for sizes that belong together: in mm or deg, or in another unit, which stays."""
    largest = max((abs(size) for size in sizes if size is not None), default=0.0)
    if unit == DEG.name:
        return MDEG if 0.0 < largest < SMALLEST_DEG else DEG
    if unit != MM.name:
        return ShownUnit(unit)
    return UM if 0.0 < largest < SMALLEST_MM else MM


def shown(size: float, sign: str = "", unit: str = "mm") -> str:
    """One size with its unit."""
    return unit_of(size, unit=unit).length(size, sign)


def rounded_up(limit: float) -> float:
    """A limit that is proposed: at least that large, with two digits."""
    step = 10.0 ** (floor(log10(limit)) - 1)
    return float(f"{step * ceil(limit / step):.2g}")


def from_to(before_mm: float, after_mm: float, decimals_before: int = 3) -> str:
    """A length before and after something, with their unit."""
    if unit_of(after_mm) is UM:
        return f"{shown(before_mm)} -> {shown(after_mm)}"
    return f"{before_mm:.{decimals_before}f} -> {after_mm:.3f} mm"
