"""Two-sided cumulative sums of many streams of standard normal values (Page, Biometrika 41, 1954, 100)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array

REFERENCE = 0.5
"""Half the shift that is found soonest, in standard deviations of a value."""


@dataclass(frozen=True, slots=True, eq=False)
class CumulativeSums:
    """The sums (m,) of m streams upwards and downwards, none negative."""

    up: Array
    down: Array

    @classmethod
    def at_rest(cls, streams: int) -> CumulativeSums:
        """Before the first value."""
        return cls(np.zeros(streams), np.zeros(streams))

    def after(self, values: Array) -> CumulativeSums:
        """With one more value of each stream (m,); NaN where a stream has none this time."""
        is_known = ~np.isnan(values)
        up = np.where(is_known, np.maximum(0.0, self.up + values - REFERENCE), self.up)
        down = np.where(is_known, np.maximum(0.0, self.down - values - REFERENCE), self.down)
        return CumulativeSums(up, down)

    @property
    def largest(self) -> Array:
        """The larger sum (m,) of each stream."""
        return np.maximum(self.up, self.down)
