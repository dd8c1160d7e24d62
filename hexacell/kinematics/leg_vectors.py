"""What the constraints and frames of six-legged mechanisms have in common: vectors of legs and joints."""

from __future__ import annotations

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.rotations import Array

CLOSEST_JOINTS_MM = 1e-6
"""Joints that are closer than that are at one place."""


def by_pose(b: Array, n: Array) -> Array:
    """Derivatives (n, 6, 6) of the legs' lengths by the pose: ``[n, b x n]``.

    Args:
        b: (n, 6, 3) from the ball to the platform joints, in the base frame, mm.
        n: (n, 6, 3) direction of each leg towards the platform, of length 1 where the leg closes.
    """
    jacobian = np.empty((*n.shape[:-1], 6))
    jacobian[..., :3] = n
    # np.cross would cost as much as the rest of a Newton step.
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    nx, ny, nz = n[..., 0], n[..., 1], n[..., 2]
    jacobian[..., 3] = by * nz - bz * ny
    jacobian[..., 4] = bz * nx - bx * nz
    jacobian[..., 5] = bx * ny - by * nx
    return jacobian


def mean_radius(geometry: Geometry | GeometryBatch, symbol: str) -> Array:
    """Mean distance (...,), mm, of the platform joints (..., 6, 3) of that symbol from the ball."""

    def compute() -> Array:
        joints = geometry[symbol]
        radius: Array = np.sqrt(np.einsum("...i,...i->...", joints, joints)).mean(axis=-1)
        return radius

    return geometry.once("mean radius", compute)


def axes_through(first: Array, second: Array, third: Array, part: str) -> Array:
    """The axes (3, 3), in rows, that three joints of a ``part`` fix.

    x from the first to the second, z normal to the plane of all three, y toward the third.

    Raises:
        UsageError: the joints are in one line, or two of them at one place.
    """
    if (width := np.linalg.norm(second - first)) < CLOSEST_JOINTS_MM:
        raise UsageError(f"two {part} joints that fix the frame are at one place")
    x = (second - first) / width
    z = np.cross(x, third - first)
    if (height := np.linalg.norm(z)) < CLOSEST_JOINTS_MM:
        raise UsageError(f"the {part} joints that fix the frame are in one line")
    z /= height
    return np.stack([x, np.cross(z, x), z])
