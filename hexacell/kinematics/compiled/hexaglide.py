"""Inverse kinematics and derivatives of the Hexaglide, pose by pose, compiled.

See :mod:`hexacell.kinematics.mechanisms.hexaglide`. Its parameters are ``sliders`` and ``platform`` (6, 3)
and ``lengths`` (6,).
"""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.compiled.leg_margins import place
from hexacell.kinematics.compiled.matrices import compiled
from hexacell.kinematics.rotations import Array


@compiled
def inverse(
    sliders: Array,
    platform: Array,
    lengths: Array,
    branch: Array,
    positions: Array,
    rotations: Array,
    joints: Array,
) -> None:
    """Fill ``joints`` (n, 6), mm, on a ``branch`` (6,); NaN out of reach."""
    ends = np.empty((6, 3))
    for row in range(len(positions)):
        place(platform, positions[row], rotations[row], ends)
        for leg in range(6):
            y, z = sliders[leg, 1] - ends[leg, 1], sliders[leg, 2] - ends[leg, 2]
            squared = lengths[leg] * lengths[leg] - y * y - z * z
            joints[row, leg] = branch[leg] * np.sqrt(squared) - (sliders[leg, 0] - ends[leg, 0])


@compiled
def derivatives(
    sliders: Array,
    platform: Array,
    lengths: Array,
    positions: Array,
    rotations: Array,
    joints: Array,
    by_pose: Array,
    by_joints: Array,
    by_numbers: Array,
) -> None:
    """Fill ``by_pose`` (n, 6, 6), ``by_joints`` (n, 6), ``by_numbers`` (n, 6, 7) at ``joints`` (n, 6)."""
    b, n = np.empty(3), np.empty(3)
    for row in range(len(positions)):
        rotation = rotations[row]
        for leg in range(6):
            for axis in range(3):
                b[axis] = 0.0
                for other in range(3):
                    b[axis] += rotation[axis, other] * platform[leg, other]
                n[axis] = sliders[leg, axis] - positions[row, axis] - b[axis]
            n[0] += joints[row, leg]
            squared = 0.0
            for axis in range(3):
                n[axis] /= lengths[leg]
                squared += n[axis] * n[axis]
            for axis in range(3):
                along, across = (axis + 1) % 3, (axis + 2) % 3
                by_pose[row, leg, axis] = -n[axis]
                by_pose[row, leg, 3 + axis] = b[across] * n[along] - b[along] * n[across]
                by_numbers[row, leg, axis] = n[axis]
                in_platform = 0.0
                for other in range(3):
                    in_platform += n[other] * rotation[other, axis]
                by_numbers[row, leg, 3 + axis] = -in_platform
            by_joints[row, leg] = n[0]
            by_numbers[row, leg, 6] = -0.5 * (squared + 1.0)
