"""Limits of passive joints and legs, pose by pose, compiled; see :mod:`hexacell.limits.leg_limits`.

Poses are given by their legs, or by what closes these and does not turn what carries their joints.
"""

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
    least_base, least_platform = _cosines(base_cones), _cosines(platform_cones)
    for row in range(len(kept)):
        kept[row] = _keeps_one(
            base_joints[row],
            platform_joints[row],
            rotations[row],
            carriers[row if len(carriers) > 1 else 0],
            base_axes,
            platform_axes,
            least_base,
            least_platform,
            distance,
            parallel,
        )


@compiled
def keeps_at(
    base: Array,
    platform: Array,
    positions: Array,
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
    """As :func:`keeps` of poses (n), with ``base`` and ``platform`` (n, 6, 3) or (1, 6, 3) of a closure."""
    least_base, least_platform = _cosines(base_cones), _cosines(platform_cones)
    ends = np.empty((6, 3))
    for row in range(len(kept)):
        place(platform[row if len(platform) > 1 else 0], positions[row], rotations[row], ends)
        kept[row] = _keeps_one(
            base[row if len(base) > 1 else 0],
            ends,
            rotations[row],
            carriers[0],
            base_axes,
            platform_axes,
            least_base,
            least_platform,
            distance,
            parallel,
        )


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
        _margins_of_one(
            base_joints[row],
            platform_joints[row],
            rotations[row],
            carriers[row if len(carriers) > 1 else 0],
            base_axes,
            platform_axes,
            base_cones,
            platform_cones,
            distance,
            parallel,
            margin[row],
        )


@compiled
def margins_at(
    base: Array,
    platform: Array,
    positions: Array,
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
    """As :func:`margins`, of what :func:`keeps_at` takes."""
    ends = np.empty((6, 3))
    for row in range(len(margin)):
        place(platform[row if len(platform) > 1 else 0], positions[row], rotations[row], ends)
        _margins_of_one(
            base[row if len(base) > 1 else 0],
            ends,
            rotations[row],
            carriers[0],
            base_axes,
            platform_axes,
            base_cones,
            platform_cones,
            distance,
            parallel,
            margin[row],
        )


@compiled
def place(platform: Array, position: Array, rotation: Array, ends: Array) -> None:
    """Fill ``ends`` (6, 3): where the joints (6, 3) of a platform at a pose are, in the base frame."""
    for leg in range(6):
        x, y, z = platform[leg]
        for axis in range(3):
            along = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * z
            ends[leg, axis] = position[axis] + along


@compiled
def _keeps_one(
    base_joints: Array,
    platform_joints: Array,
    rotation: Array,
    carriers: Array,
    base_axes: Array,
    platform_axes: Array,
    least_base: Array,
    least_platform: Array,
    distance: float,
    parallel: float,
) -> bool:
    """Whether one pose does, with the least cosines (6,) of the cones."""
    for leg in range(6):
        start, end = platform_joints[leg], base_joints[leg]
        x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        if not _cosine(rotation, platform_axes[leg], x, y, z) >= least_platform[leg]:
            return False
        if not _cosine(carriers[leg], base_axes[leg], x, y, z) >= least_base[leg]:
            return False
    return distance == 0.0 or smallest_distance(base_joints, platform_joints, parallel) >= distance


@compiled
def _margins_of_one(
    base_joints: Array,
    platform_joints: Array,
    rotation: Array,
    carriers: Array,
    base_axes: Array,
    platform_axes: Array,
    base_cones: Array,
    platform_cones: Array,
    distance: float,
    parallel: float,
    margin: Array,
) -> None:
    """Fill ``margin`` (12 or 13,) of one pose."""
    for leg in range(6):
        start, end = platform_joints[leg], base_joints[leg]
        x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        at_base = _cosine(carriers[leg], base_axes[leg], x, y, z)
        at_platform = _cosine(rotation, platform_axes[leg], x, y, z)
        margin[leg] = base_cones[leg] - np.arccos(min(max(at_base, -1.0), 1.0))
        margin[6 + leg] = platform_cones[leg] - np.arccos(min(max(at_platform, -1.0), 1.0))
    if len(margin) > 12:
        margin[12] = smallest_distance(base_joints, platform_joints, parallel) - distance


@compiled
def _cosine(rotation: Array, axis: Array, x: float, y: float, z: float) -> float:
    """Of the angle between a unit vector x, y, z and a unit ``axis`` (3,) that is rotated."""
    cosine = 0.0
    for column in range(3):
        seen = rotation[0, column] * x + rotation[1, column] * y + rotation[2, column] * z
        cosine += seen * axis[column]
    return cosine


@compiled
def _cosines(cones: Array) -> Array:
    """The least cosine of the angles in each cone (6,): none is in a negative one, all in one beyond pi."""
    least = np.empty(6)
    for leg in range(6):
        least[leg] = np.cos(min(cones[leg], np.pi))
        if cones[leg] < 0.0:
            least[leg] = 2.0
        elif cones[leg] >= np.pi:
            least[leg] = -2.0
    return least
