"""A scene in characters: eight dots of braille each, with the role by which a terminal colours them."""

from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from hexacell.drawing.camera import Camera
from hexacell.drawing.shapes import Form, Role, Scene, Shape
from hexacell.kinematics.rotations import Array

DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the dots of a character: two columns of four."""

EMPTY = 0x2800


@dataclass(frozen=True, slots=True)
class Run:
    """Characters of a line that have one colour: that of a role; None for blanks."""

    text: str
    role: Role | None


def braille_lines(scene: Scene, width: int, height: int) -> list[tuple[Run, ...]]:
    """The picture as ``height`` lines of ``width`` characters, each line in runs of one colour."""
    camera = Camera.fitted(scene, (2.0 * width, 4.0 * height), 1.0)
    ordered = camera.back_to_front(scene)
    bits, roles = np.zeros((height, width), dtype=int), np.full((height, width), None, dtype=object)
    for shape in ordered:
        if shape.form is not Form.WORD:
            for x, y in np.unique(np.floor(_dots(shape, camera)).astype(int), axis=0).tolist():
                bits[y // 4, x // 2] |= DOTS[x % 2][y % 4]
                roles[y // 4, x // 2] = shape.role
    signs = [[chr(EMPTY + one) if one else " " for one in row] for row in bits.tolist()]
    for word in sorted(ordered, key=lambda one: one.role is Role.LEG):  # numbers are never covered
        if word.form is Form.WORD:
            x, y = camera.places(word.points)[0]
            column = int(x // 2) - (1 - camera.side(word)) * len(word.text) // 2
            column, row = min(max(column, 0), width - len(word.text)), int(y // 4)
            cells = slice(column, column + len(word.text))
            signs[row][cells], roles[row, cells] = word.text, word.role
    return [_runs(row, roles[place].tolist()) for place, row in enumerate(signs)]


def _runs(signs: list[str], roles: list[Role | None]) -> tuple[Run, ...]:
    groups = groupby(zip(signs, roles, strict=True), key=lambda one: one[1])
    return tuple(Run("".join(sign for sign, _ in some), role) for role, some in groups)


def _dots(shape: Shape, camera: Camera) -> Array:
    """Places (n, 2) along a shape's lines or edges, at most a dot apart."""
    places = camera.places(shape.points)
    if shape.form is Form.BALL:
        angles = np.linspace(0.0, 2.0 * np.pi, 24)
        radius = shape.size * camera.scale if shape.role is Role.BALL else 0.0
        return np.asarray(places + radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1))
    corners = np.concatenate([places, places[:1]]) if shape.form is Form.SURFACE else places
    steps = (int(np.abs(end - start).max()) + 2 for start, end in pairwise(corners))
    return np.concatenate([np.linspace(*ends, n) for ends, n in zip(pairwise(corners), steps, strict=True)])
