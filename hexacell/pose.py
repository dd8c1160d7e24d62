"""Poses at the edges: six numbers in millimetres and degrees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell import rotations
from hexacell.rotations import Array


@dataclass(frozen=True, slots=True)
class Pose:
    """A platform pose as files, controllers and people write it.

    ``x, y, z`` is the ball's centre in the base frame, mm; ``a, b, c`` are the angles about the
    fixed axes x, y, z in that order, deg: ``R = Rz(c) Ry(b) Rx(a)``.
    """

    x: float
    y: float
    z: float
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0

    @classmethod
    def of(cls, position: Array, rotation: Array) -> Pose:
        """The pose of a ball centre (3,), mm, and a rotation matrix (3, 3)."""
        angles = np.degrees(rotations.to_angles(rotation))
        return cls(*(float(value) for value in (*position, *angles)))

    @property
    def position(self) -> Array:
        """The ball's centre (3,), mm."""
        return np.array([self.x, self.y, self.z])

    @property
    def rotation(self) -> Array:
        """The rotation matrix (3, 3) from the platform frame to the base frame."""
        return rotations.from_angles(np.radians([self.a, self.b, self.c]))

    def as_tuple(self) -> tuple[float, float, float, float, float, float]:
        """``(x, y, z, a, b, c)``, mm and deg."""
        return (self.x, self.y, self.z, self.a, self.b, self.c)

    def __str__(self) -> str:
        words = zip("XYZABC", self.as_tuple(), strict=True)
        return " ".join(f"{axis}{value:.3f}" for axis, value in words)
