"""Limits of passive joints and legs, pose by pose, compiled; see :mod:`hexacell.limits.leg_limits`."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.compiled.leg_distances import smallest_distance
from hexacell.kinematics.compiled.matrices import compiled
from hexacell.kinematics.rotations import Array, Mask


@compiled
def keeps(
    base_joints: Array,
    platform_joints: Array,
    rotations: Array,
    carriers: Array,
    base_axes: Array,
    platform_axes: Array,
    base_cones: Array,
    platform_cones: Array,
    distance: float,
    parallel: float,
    kept: Mask,
) -> None:
    """Fill ``kept`` (n,): cones (6,), rad, and the smallest distance, mm; 0 for none.

    Joints are (n, 6, 3), ``carriers`` (n, 6, 3, 3), or (1, 6, 3, 3) where they do not turn.
    """
    for row in range(len(kept)):
        kept[row] = True
        for leg in range(6):
            start, end = platform_joints[row, leg], base_joints[row, leg]
            x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            length = np.sqrt(x * x + y * y + z * z)
            x, y, z = x / length, y / length, z / length
            kept[row] = _angle(rotations[row], platform_axes[leg], x, y, z) <= platform_cones[leg]
            if not kept[row]:
                break
            carrier = carriers[row if len(carriers) > 1 else 0, leg]
            kept[row] = _angle(carrier, base_axes[leg], x, y, z) <= base_cones[leg]
            if not kept[row]:
                break
        if kept[row] and distance != 0.0:
            kept[row] = smallest_distance(base_joints[row], platform_joints[row], parallel) >= distance


@compiled
def margins(
    base_joints: Array,
    platform_joints: Array,
    rotations: Array,
    carriers: Array,
    base_axes: Array,
    platform_axes: Array,
    base_cones: Array,
    platform_cones: Array,
    distance: float,
    parallel: float,
    margin: Array,
) -> None:
    """Fill ``margin`` (n, 12), rad, or (n, 13), the last that of the smallest distance, mm.

    See :func:`keeps`.
    """
    for row in range(len(margin)):
        for leg in range(6):
            start, end = platform_joints[row, leg], base_joints[row, leg]
            x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            length = np.sqrt(x * x + y * y + z * z)
            x, y, z = x / length, y / length, z / length
            carrier = carriers[row if len(carriers) > 1 else 0, leg]
            margin[row, leg] = base_cones[leg] - _angle(carrier, base_axes[leg], x, y, z)
            at_platform = _angle(rotations[row], platform_axes[leg], x, y, z)
            margin[row, 6 + leg] = platform_cones[leg] - at_platform
        if margin.shape[1] > 12:
            nearest = smallest_distance(base_joints[row], platform_joints[row], parallel)
            margin[row, 12] = nearest - distance


@compiled
def _angle(rotation: Array, axis: Array, x: float, y: float, z: float) -> float:
    """Between a unit vector x, y, z and a unit ``axis`` (3,) that is rotated, rad."""
    cosine = 0.0
    for column in range(3):
        seen = rotation[0, column] * x + rotation[1, column] * y + rotation[2, column] * z
        cosine += seen * axis[column]
    return float(np.arccos(min(max(cosine, -1.0), 1.0)))
