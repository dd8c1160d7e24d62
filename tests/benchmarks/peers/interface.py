"""What every peer is given and returns: arrays, so that its process loads nothing but its own library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Records:
    """Measurements of one Hexaglide, mm and rad, in the frames of the paper's convention.

    Attributes:
        drawing: S (6, 3), B (6, 3) and l (6) in a row (42,), where every method starts.
        basis: (42, 35), from the free parameters of the convention to all.
        branch: (6,) of each leg, along its rail, -1 or 1.
        points: (n,) at which point a record was taken, from 0, ascending.
        joints: (n, 6) by the encoders.
        deviations: (n, 3) by the gauges.
        positions: (n, 3) of the ball as commanded, which close the drawing at the joints up to noise.
        rotations: (n, 3, 3) of the platform as commanded.
        full_positions: (n, 3) by an instrument that measures whole poses in the frames of the convention.
        full_rotations: (n, 3, 3) likewise.
        encoder_mm: noise of a joint, one standard deviation.
        gauge_mm: of a deviation.
        rows: (n, 17) the same as the measurement file has it.
    """

    drawing: Array
    basis: Array
    branch: Array
    points: NDArray[np.intp]
    joints: Array
    deviations: Array
    positions: Array
    rotations: Array
    full_positions: Array
    full_rotations: Array
    encoder_mm: float
    gauge_mm: float
    rows: Array

    @property
    def free(self) -> Array:
        """The drawing's free parameters (35,)."""
        found: Array = np.linalg.lstsq(self.basis, self.drawing)[0]
        return found

    @property
    def first_positions(self) -> Array:
        """(m, 3) where the first record of each point was commanded."""
        return self.positions[np.unique(self.points, return_index=True)[1]]


Solve = Callable[[Records], Array]
"""A peer: the geometry (42,) that it identifies. It raises ``ArithmeticError`` where it finds none."""


@dataclass(frozen=True)
class Solved:
    """One solution; ``geometry`` is empty where there is none."""

    geometry: tuple[float, ...]
    wall_s: float
    processor_s: float


@dataclass(frozen=True)
class Ended:
    """What came of a peer's process: its solutions in order, or why it cannot run here."""

    solved: tuple[Solved, ...] = ()
    peak_mb: float = float("nan")
    absent: str = ""

    @classmethod
    def of(cls, document: dict[str, Any]) -> Ended:
        """From its JSON."""
        return cls(
            tuple(
                Solved(tuple(one["geometry"]), one["wall_s"], one["processor_s"])
                for one in document["solved"]
            ),
            document["peak_mb"],
            document["absent"],
        )
