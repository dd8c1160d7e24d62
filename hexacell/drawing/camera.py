"""A camera: from which direction a scene is seen, in parallel projection, fitted to a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.drawing.shapes import AXIS_ROLES, Label, Line, Role, Scene, Shape, Surface
from hexacell.kinematics.rotations import Array

DIRECTION_DEG = (-64.0, 22.0)
"""From the front, somewhat from the right and from above: no two of the base's axes cover each other."""

IN_FRONT = {Role.BALL, *AXIS_ROLES}
ERRORS = {Role.BEFORE, Role.AFTER}


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
    def fitted(
        cls,
        scene: Scene,
        size: tuple[float, float],
        margin: float,
        direction_deg: tuple[float, float] = DIRECTION_DEG,
    ) -> Camera:
        """A camera in whose frame all points of a scene are, as large as possible.

        Args:
            scene: what is seen.
            size: width and height of the frame, which has square units.
            margin: what stays free at each edge, in the same units.
            direction_deg: where the viewer is: azimuth from the x axis, and height above the xy plane, deg.
        """
        azimuth, height = np.radians(direction_deg)
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        away = np.array(
            [np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)]
        )
        axes = np.stack([right, np.cross(away, right), away])
        flat = scene.points @ axes[:2].T * (1.0, -1.0)
        lowest, highest = flat.min(axis=0), flat.max(axis=0)
        room = np.maximum(np.array(size) - 2.0 * margin, 1.0)
        scale = float(np.min(room / np.maximum(highest - lowest, 1e-9)))
        return cls(axes, scale, np.array(size) / 2.0 - scale * (lowest + highest) / 2.0)

    def places(self, points: Array) -> Array:
        """Where points (n, 3), mm, are in the frame (n, 2)."""
        return np.asarray(self.origin + self.scale * (points @ self.axes[:2].T) * (1.0, -1.0))

    def side(self, label: Label) -> int:
        """Whether a label begins at its place, 1, ends there, -1, or has it in its middle, 0."""
        shown = self.places(label.points)
        across, upward = np.abs(shown[0] - shown[-1])
        return int(np.sign(shown[0, 0] - shown[-1, 0])) if across > 0.3 * upward else 0

    def back_to_front(self, scene: Scene) -> list[Shape]:
        """The shapes in the order of a painter: what is nearer is later, and covers the others.

        The base is behind all, and before them are errors and words, which must be seen.
        """
        return sorted(
            scene.shapes, key=lambda one: (_layer(one), float((one.points @ self.axes[2]).mean()))
        )


def _layer(shape: Shape) -> int:
    if isinstance(shape, Label) or shape.role in ERRORS:
        return 5 if shape.role is Role.AFTER else 4  # the smaller ones
    if shape.role in IN_FRONT:  # but the axes of the base frame, which may be behind
        return 2 if isinstance(shape, Line) and shape.has_head else 3
    if shape.role in {Role.BASE, Role.RAIL}:
        return 0 if isinstance(shape, Surface) else 1
    return 2
