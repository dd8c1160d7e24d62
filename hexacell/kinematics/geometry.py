"""The 42 numbers of a six-legged mechanism, their names and their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.kinematics.rotations import Array

LEGS = 6
PARAMETERS = 42
PARAMETER_NAMES: tuple[str, ...] = (
    *(f"S{leg}{axis}" for leg in range(1, 7) for axis in "xyz"),
    *(f"B{leg}{axis}" for leg in range(1, 7) for axis in "xyz"),
    *(f"l{leg}" for leg in range(1, 7)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """Where a robot's joints are and how long its legs are, mm.

    Attributes:
        S: joints on the sliders (6, 3) in the base frame at joint variable zero.
        B: joints on the platform (6, 3) in the platform frame, whose origin is the ball.
        l: leg lengths (6,).

    The arrays are read-only copies. The vector form has the order of ``PARAMETER_NAMES``.
    """

    S: Array
    B: Array
    l: Array  # noqa: E741 - the paper's symbol

    def __init__(self, S: ArrayLike, B: ArrayLike, l: ArrayLike) -> None:  # noqa: E741
        for name, value, shape in (("S", S, (LEGS, 3)), ("B", B, (LEGS, 3)), ("l", l, (LEGS,))):
            array = np.array(value, dtype=float)
            if array.shape != shape:
                raise ValueError(f"{name} has the shape {array.shape}, not {shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> Geometry:
        """The geometry of 42 numbers in the order of ``PARAMETER_NAMES``, mm."""
        vector = np.asarray(vector, dtype=float)
        return cls(vector[:18].reshape(LEGS, 3), vector[18:36].reshape(LEGS, 3), vector[36:])

    def vector(self) -> Array:
        """The 42 numbers in the order of ``PARAMETER_NAMES``, mm."""
        return np.concatenate([self.S.ravel(), self.B.ravel(), self.l])

    def largest_difference(self, other: Geometry) -> float:
        """Largest absolute difference of a parameter, mm."""
        return float(np.max(np.abs(self.vector() - other.vector())))

    def interpolate(self, other: Geometry, fraction: float) -> Geometry:
        """The geometry ``fraction`` of the way to ``other``; 0 is this one, 1 the other."""
        return Geometry.from_vector((1.0 - fraction) * self.vector() + fraction * other.vector())


@dataclass(frozen=True, slots=True, eq=False)
class GeometryBatch:
    """A geometry for each of n poses, all computed at once, mm.

    Attributes:
        S: joints on the sliders (n, 6, 3).
        B: joints on the platform (n, 6, 3).
        l: leg lengths (n, 6).
    """

    S: Array
    B: Array
    l: Array  # noqa: E741 - the paper's symbol

    @classmethod
    def from_vectors(cls, vectors: Array) -> GeometryBatch:
        """Of vectors (n, 42) in the order of ``PARAMETER_NAMES``, mm."""
        return cls(
            vectors[:, :18].reshape(-1, LEGS, 3), vectors[:, 18:36].reshape(-1, LEGS, 3), vectors[:, 36:]
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> GeometryBatch:
        return GeometryBatch(self.S[rows], self.B[rows], self.l[rows])
