"""What every picture is made of: lines, surfaces, balls and labels in space, each with a role."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hexacell.kinematics.rotations import Array


class Role(StrEnum):
    """What a shape stands for; a picture chooses colours and widths by it.

    X, Y and Z are the axes of the base frame, and the gauges that measure along them. BEFORE and AFTER are
    errors, and a geometry, before and after a calibration.
    """

    BASE = "base"
    RAIL = "rail"
    DRIVE = "drive"
    LEG = "leg"
    PLATFORM = "platform"
    BALL = "ball"
    X = "x"
    Y = "y"
    Z = "z"
    BEFORE = "before"
    AFTER = "after"


AXIS_ROLES = (Role.X, Role.Y, Role.Z)

COLOURS = {
    Role.BASE: "#7d8794",
    Role.RAIL: "#7d8794",
    Role.DRIVE: "#566473",
    Role.LEG: "#8fa1b3",
    Role.PLATFORM: "#159a8c",
    Role.BALL: "#d99a00",
    Role.X: "#d1495b",
    Role.Y: "#2e9e5b",
    Role.Z: "#3d7fd1",
    Role.BEFORE: "#b35806",
    Role.AFTER: "#2166ac",
}
"""Each is readable on white and on black; before and after are apart for colour-blind readers too."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line through points (m, 3), mm, so many times as wide as its role says; it may end in a head."""

    role: Role
    points: Array
    has_head: bool = False
    weight: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A flat surface with the corners (m, 3), mm."""

    role: Role
    points: Array


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """A ball or the ball of a joint, about a centre (1, 3), mm."""

    role: Role
    points: Array
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A short text about a place (1, 3), mm; or at the first of two (2, 3), away from the other."""

    role: Role
    points: Array
    text: str


Shape = Line | Surface | Ball | Label


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Shapes that are seen together."""

    shapes: tuple[Shape, ...]

    def __add__(self, others: Scene) -> Scene:
        return Scene(self.shapes + others.shapes)

    @property
    def points(self) -> Array:
        """All points (n, 3), mm, that a picture must show."""
        return np.concatenate([shape.points for shape in self.shapes])


def arrows(role: Role, starts: Array, vectors: Array) -> Scene:
    """A vector (n, 3), as long as it is to be drawn, from each of n points (n, 3), mm."""
    pairs = zip(starts, vectors, strict=True)
    return Scene(tuple(Line(role, np.stack([at, at + along]), has_head=True) for at, along in pairs))


def enlargement(vectors: Iterable[Array], longest: float) -> float:
    """The round factor, from 1, at which the longest of some vectors (n, 3) is drawn at most that long."""
    largest = max((float(np.linalg.norm(one, axis=-1).max(initial=0.0)) for one in vectors), default=0.0)
    if largest == 0.0 or longest <= largest:
        return 1.0
    power = 10.0 ** np.floor(np.log10(longest / largest))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power * largest <= longest))
