"""The constraints of one pose and their derivatives, compiled."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.compiled.matrices import compiled
from hexacell.kinematics.rotations import Array


@compiled
def constraints(
    base: Array,
    platform: Array,
    lengths: Array,
    is_quadratic: bool,
    position: Array,
    rotation: Array,
    error: Array,
    jacobian: Array,
) -> float:
    """Fill ``error`` (6,) and ``jacobian`` (6, 6) of six legs at a pose; returns the largest error, mm.

    ``base`` and ``platform`` (6, 3) and ``lengths`` (6,) are as in
    :class:`~hexacell.kinematics.leg_closure.LegClosure`; not a number if one of them is.
    """
    largest = 0.0
    for leg in range(6):
        p, q, r = platform[leg, 0], platform[leg, 1], platform[leg, 2]
        bx = rotation[0, 0] * p + rotation[0, 1] * q + rotation[0, 2] * r
        by = rotation[1, 0] * p + rotation[1, 1] * q + rotation[1, 2] * r
        bz = rotation[2, 0] * p + rotation[2, 1] * q + rotation[2, 2] * r
        x = position[0] + bx - base[leg, 0]
        y = position[1] + by - base[leg, 1]
        z = position[2] + bz - base[leg, 2]
        squared, length = x * x + y * y + z * z, lengths[leg]
        if is_quadratic:
            error[leg] = (squared - length * length) / (2.0 * length)
            scale = 1.0 / length
        else:
            distance = np.sqrt(squared)
            error[leg] = distance - length
            scale = 1.0 / distance
        x, y, z = scale * x, scale * y, scale * z
        jacobian[leg, 0], jacobian[leg, 1], jacobian[leg, 2] = x, y, z
        jacobian[leg, 3] = by * z - bz * y
        jacobian[leg, 4] = bz * x - bx * z
        jacobian[leg, 5] = bx * y - by * x
        if not abs(error[leg]) <= largest:  # not a number too
            largest = abs(error[leg])
            if np.isnan(largest):
                break
    return float(largest)
