"""Ranges of joint variables, where a controller's own are of joints that include the encoders' zeros."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class ZeroedRanges:
    """Ranges (6,) of the joint variables, and of those plus the zeros, which a calibration changes.

    Attributes:
        lowest: joint variable of each leg, and ``highest``.
        lowest_told: the same with the zero, as the controller tells it, and ``highest_told``.
    """

    lowest: Array
    highest: Array
    lowest_told: Array
    highest_told: Array

    def at(self, zeros: Array) -> tuple[Array, Array]:
        """Lowest and highest joint variables that both allow, where a controller has these zeros (6,)."""
        return (
            np.maximum(self.lowest, self.lowest_told - zeros),
            np.minimum(self.highest, self.highest_told - zeros),
        )
