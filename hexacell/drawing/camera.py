"""A camera: from which direction a scene is seen, in parallel projection, fitted to a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.drawing.shapes import AXIS_ROLES, Form, Role, Scene, Shape
from hexacell.kinematics.rotations import Array

DIRECTION_DEG = (-64.0, 22.0)
"""The viewer's azimuth from the x axis and height above the xy plane: no two of the base's axes cover."""


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """What turns points in space into places in a frame.

    Attributes:
        axes: (3, 3) unit vectors in rows: to the right, upward, and towards the viewer.
        scale: of lengths, units of the frame by mm.
        origin: (2,) where the base frame's origin is in the frame; y counts downward there.
    """

    axes: Array
    scale: float
    origin: Array

    @classmethod
    def fitted(cls, scene: Scene, size: tuple[float, float], margin: float) -> Camera:
        """A camera in whose frame, of a width and a height, a scene is as large as possible."""
        azimuth, height = np.radians(DIRECTION_DEG)
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        toward = np.array([*np.cos(height) * np.array([np.cos(azimuth), np.sin(azimuth)]), np.sin(height)])
        unfitted = cls(np.stack([right, np.cross(toward, right), toward]), 1.0, np.zeros(2))
        shown = np.concatenate([unfitted.places(one.points) for one in scene])
        lowest, highest = shown.min(axis=0), shown.max(axis=0)
        room = np.maximum(np.array(size) - 2.0 * margin, 1.0)
        scale = float(np.min(room / np.maximum(highest - lowest, 1e-9)))
        return cls(unfitted.axes, scale, np.array(size) / 2.0 - scale * (lowest + highest) / 2.0)

    def places(self, points: Array) -> Array:
        """Where points (n, 3), mm, are in the frame (n, 2)."""
        return np.asarray(self.origin + self.scale * (points @ self.axes[:2].T) * (1.0, -1.0))

    def side(self, word: Shape) -> int:
        """Whether a word begins at its place, 1, ends there, -1, or has it in its middle, 0."""
        across, downward = self.places(word.points)[0] - self.places(word.points)[-1]
        return int(np.sign(across)) if abs(across) > 0.3 * abs(downward) else 0

    def back_to_front(self, scene: Scene) -> list[Shape]:
        """The shapes in the order of a painter: what is nearer is later, and covers the others.

        The base is behind all, and before them are gauges, errors and words, which must be seen.
        """
        return sorted(scene, key=lambda one: (_layer(one), float((one.points @ self.axes[2]).mean())))


def _layer(shape: Shape) -> int:
    if shape.form is Form.WORD:
        return 6
    if shape.role in {Role.BEFORE, Role.AFTER}:
        return 5 if shape.role is Role.AFTER else 4  # the smaller ones
    if shape.role in {Role.BALL, *AXIS_ROLES}:  # but the axes of the base frame, which may be behind
        return 2 if shape.form is Form.ARROW else 3
    if shape.role in {Role.BASE, Role.RAIL}:
        return 0 if shape.form is Form.SURFACE else 1
    return 2
