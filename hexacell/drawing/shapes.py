"""What every picture is made of: lines, arrows, surfaces, balls and words in space, each with a role."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum, auto

import numpy as np

from hexacell.kinematics.rotations import Array


class Role(StrEnum):
    """What a shape stands for; a picture chooses colours and widths by it.

    X, Y and Z are the axes of the base frame, and the gauges that measure along them. BEFORE and AFTER are
    errors, and a geometry, before and after a calibration.
    """

    BASE = auto()
    RAIL = auto()
    DRIVE = auto()
    LEG = auto()
    PLATFORM = auto()
    BALL = auto()
    X = auto()
    Y = auto()
    Z = auto()
    BEFORE = auto()
    AFTER = auto()


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


Form = StrEnum("Form", ["LINE", "ARROW", "SURFACE", "BALL", "WORD"])
"""What a shape is."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One thing in space.

    Attributes:
        points: (m, 3), mm: along a line, corners of a flat surface, the centre of a ball. A word is about
            its only point, or begins at the first of two, away from the other.
        size: radius of a ball, mm; how many times as wide as others of its role a line is.
        text: the word.
    """

    form: Form
    role: Role
    points: Array
    size: float = 1.0
    text: str = ""


Scene = tuple[Shape, ...]
"""Shapes that are seen together."""


def arrows(role: Role, starts: Array, vectors: Array) -> Scene:
    """A vector (n, 3), as long as it is to be drawn, from each of n points (n, 3), mm."""
    return tuple(Shape(Form.ARROW, role, ends) for ends in np.stack([starts, starts + vectors], axis=1))


def enlargement(vectors: Iterable[Array], longest: float) -> float:
    """The round factor, from 1, at which the longest of some vectors (n, 3) is drawn at most that long."""
    largest = max((float(np.linalg.norm(one, axis=-1).max()) for one in vectors), default=0.0)
    if largest == 0.0 or longest <= largest:
        return 1.0
    power = 10.0 ** np.floor(np.log10(longest / largest))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power * largest <= longest))
