"""A scene in characters: eight dots of braille each, with the role by which a terminal colours them."""

from dataclasses import dataclass, field
from itertools import groupby, pairwise

import numpy as np

from hexacell.drawing.camera import DIRECTION_DEG, Camera
from hexacell.drawing.shapes import Ball, Label, Line, Role, Scene, Shape
from hexacell.kinematics.rotations import Array

DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the dots of a character: two columns of four."""

EMPTY = 0x2800


@dataclass(frozen=True, slots=True)
class Run:
    """Characters of a line that have one colour: that of a role; None for blanks."""

    text: str
    role: Role | None


@dataclass(slots=True)
class _Canvas:
    width: int
    height: int
    bits: dict[tuple[int, int], int] = field(default_factory=dict)
    words: dict[tuple[int, int], str] = field(default_factory=dict)
    roles: dict[tuple[int, int], Role] = field(default_factory=dict)

    def dots(self, places: Array, role: Role) -> None:
        """Set the dots at some places (n, 2)."""
        for x, y in np.unique(np.floor(places).astype(int), axis=0).tolist():
            cell = (x // 2, y // 4)
            self.bits[cell] = self.bits.get(cell, 0) | DOTS[x % 2][y % 4]
            self.roles[cell] = role

    def word(self, place: Array, label: Label, side: int) -> None:
        """Put a short text in the place of dots; what another word has already keeps its place."""
        text, role = label.text, label.role
        column, row = int(place[0] // 2) - (1 - side) * len(text) // 2, int(place[1] // 4)
        column = min(max(column, 0), self.width - len(text))
        cells = [(column + place, row) for place in range(len(text))]
        if not any(cell in self.words for cell in cells):
            for cell, sign in zip(cells, text, strict=True):
                self.words[cell], self.roles[cell] = sign, role

    def line(self, row: int) -> tuple[Run, ...]:
        """The runs of a line."""
        signs = [
            (self.words.get(cell) or _sign(self.bits.get(cell, 0)), self.roles.get(cell))
            for cell in ((column, row) for column in range(self.width))
        ]
        groups = groupby(signs, key=lambda one: one[1])
        return tuple(Run("".join(sign for sign, _ in some), role) for role, some in groups)


def braille_lines(
    scene: Scene, width: int, height: int, direction_deg: tuple[float, float] = DIRECTION_DEG
) -> list[tuple[Run, ...]]:
    """The picture as ``height`` lines of ``width`` characters, each line in runs of one colour."""
    camera = Camera.fitted(scene, (2.0 * width, 4.0 * height), 1.0, direction_deg)
    canvas = _Canvas(width, height)
    for shape in camera.back_to_front(scene):
        places = camera.places(shape.points)
        if isinstance(shape, Label):
            canvas.word(places[0], shape, camera.side(shape))
        else:
            canvas.dots(_outline(shape, places, camera.scale), shape.role)
    return [canvas.line(row) for row in range(height)]


def _outline(shape: Shape, places: Array, scale: float) -> Array:
    """Places (n, 2) along a shape's lines or edges, at most a dot apart."""
    if isinstance(shape, Ball):
        angles = np.linspace(0.0, 2.0 * np.pi, 24)
        radius = shape.radius * scale if shape.role is Role.BALL else 0.0
        return np.asarray(places + radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1))
    corners = places if isinstance(shape, Line) else np.concatenate([places, places[:1]])
    pieces = [_between(start, end) for start, end in pairwise(corners)]
    return np.concatenate(pieces)


def _between(start: Array, end: Array) -> Array:
    steps = max(2, int(np.ceil(np.abs(end - start).max())) + 1)
    return np.linspace(start, end, steps)


def _sign(bits: int) -> str:
    return chr(EMPTY + bits) if bits else " "
