"""Single causes of a change of a robot: its parameters, each taken alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """Single causes of a change.

    Attributes:
        by_state: (m, s) change of the state by one unit of each.
        legs: (m,) the leg of each, from 1.
        free: how many numbers of the state are free parameters; the others are shared causes.
    """

    by_state: Array
    legs: NDArray[np.int_]
    free: int
