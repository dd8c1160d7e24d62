"""How far the ball may go from where the gauges were zeroed, on either side of each gauge.

A plunger has the same travel to both sides of its middle. Where it stood when the gauges were zeroed says
how much of that is left on each side. Three gauges mounted together have the ball in the middle of their
plates when all plungers are in the middle of their travels, so the same place says how far the ball may go
on the plates. Lengths are in mm, along base x, y, z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hexacell.kinematics.rotations import Array, Mask

Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class GaugeRoom:
    """The deviations that gauges allow: from ``lower``, which is negative, to ``upper``."""

    lower: Three
    upper: Three

    @classmethod
    def symmetric(cls, distance_mm: float) -> "GaugeRoom":
        """Room of one distance on all sides."""
        return cls((-distance_mm,) * 3, (distance_mm,) * 3)

    def __str__(self) -> str:
        """In words: what is left to both sides, along x, y and z where it differs."""
        if self == GaugeRoom.symmetric(self.upper[0]):
            return f"{self.upper[0]:g} mm"
        sides = zip("xyz", self.lower, self.upper, strict=True)
        return ", ".join(f"{axis} {lower:+.2f} to {upper:+.2f} mm" for axis, lower, upper in sides)

    @property
    def smallest_mm(self) -> float:
        """What is left on the narrowest side."""
        return min(*self.upper, *(-one for one in self.lower))

    def holds(self, deviations: Array, spread: Array | float = 0.0, share: float = 1.0) -> Mask:
        """Which deviations (..., 3), with a spread to both sides, stay within a share of the room."""
        above = deviations + spread <= share * np.array(self.upper)
        below = deviations - spread >= share * np.array(self.lower)
        return np.asarray((above & below).all(axis=-1))

    def widened(self, margin_mm: float) -> "GaugeRoom":
        """This room with a margin on all sides."""
        x, y, z = (one - margin_mm for one in self.lower)
        u, v, w = (one + margin_mm for one in self.upper)
        return GaugeRoom((x, y, z), (u, v, w))


@dataclass(frozen=True, slots=True)
class GaugeTravel:
    """The travels of the gauges x, y and z, and what is known of their plungers' places.

    Attributes:
        plate_mm: how far the ball may go from the middle of the plates, and from the gauges' zero.
        half_mm: of each gauge half of its measuring range.
        middle_mm: what each shows in the middle of its travel, along its base axis; None where its display
            does not say.
        mounting_mm: how far from the middle a plunger may stand when the gauges are zeroed.
    """

    plate_mm: float
    half_mm: Three
    middle_mm: tuple[float | None, float | None, float | None]
    mounting_mm: float

    def places(self, shown_mm: Three) -> tuple[float | None, ...]:
        """How far each plunger stands from the middle of its travel; None where that is not known.

        ``shown_mm`` is what the gauges show along their base axes.
        """
        pairs = zip(shown_mm, self.middle_mm, strict=True)
        return tuple(None if middle is None else shown - middle for shown, middle in pairs)

    @lru_cache(maxsize=16)  # noqa: B019 - a program has few gauges
    def room(self, zero_mm: Three | None = None) -> GaugeRoom:
        """The room of gauges that showed ``zero_mm`` when they were zeroed.

        Before they are, gauges whose display shows their place are expected in the middle. The others may
        be as far from it as ``mounting_mm``, wherever they are.
        """
        if zero_mm is None:
            return self._room([None if middle is None else 0.0 for middle in self.middle_mm])
        return self._room(self.places(zero_mm))

    @property
    def sure_room(self) -> GaugeRoom:
        """The room that every station has whose plungers stand no farther from the middle than allowed."""
        return self._room((None, None, None))

    def _room(self, places: Sequence[float | None]) -> GaugeRoom:
        """The room of plungers at these places; one that is not known may be anywhere on its mounting."""
        lower, upper = [], []
        for half, place in zip(self.half_mm, places, strict=True):
            lowest, highest = (-self.mounting_mm, self.mounting_mm) if place is None else (place, place)
            reach = min(self.plate_mm, half)
            lower.append(max(-self.plate_mm, -reach - lowest))
            upper.append(min(self.plate_mm, reach - highest))
        (a, b, c), (u, v, w) = lower, upper
        return GaugeRoom((a, b, c), (u, v, w))
