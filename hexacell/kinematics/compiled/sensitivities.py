"""Derivatives of poses by joint variables and free parameters, pose by pose, compiled.

See :mod:`hexacell.kinematics.free_sensitivity`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.compiled.margins import margin_by_norms
from hexacell.kinematics.compiled.matrices import compiled, eliminate
from hexacell.kinematics.rotations import Array


@compiled
def by_joints_and_free(
    pose: Array,
    joints: Array,
    parameters: Array,
    columns: NDArray[np.intp],
    radius: float,
    margin: float,
    by_joints: Array,
    by_free: Array,
    determinants: Array,
    decided: NDArray[np.int8],
) -> None:
    """Fill ``by_joints`` (n, m, 6) and ``determinants`` (n,), and add to ``by_free`` (n, m, p).

    ``pose`` (n, 6, 6), ``joints`` (n, 6) and ``parameters`` (n, 6, c) are derivatives of the constraints;
    ``columns`` (6, c) say which free parameter a number of a leg is, -1 if none. All is meaningless where a
    determinant is 0. With a ``margin`` above 0, ``decided`` (n,) is filled as by
    :func:`~.margins.margins_and_modes`, rotations being scaled by the ``radius``, mm.
    """
    system = np.empty((6, 12))
    for row in range(len(pose)):
        for leg in range(6):
            for axis in range(6):
                system[leg, axis] = pose[row, leg, axis]
                system[leg, 6 + axis] = 1.0 if axis == leg else 0.0
        determinants[row] = eliminate(system)
        for coordinate in range(by_joints.shape[1]):
            for leg in range(6):
                change = -system[coordinate, 6 + leg]
                by_joints[row, coordinate, leg] = change * joints[row, leg]
                for number in range(columns.shape[1]):
                    column = columns[leg, number]
                    if column >= 0:
                        by_free[row, coordinate, column] += change * parameters[row, leg, number]
        if margin > 0.0:
            decided[row] = _decide_scaled(system[:, 6:], radius, margin)


@compiled
def _decide_scaled(inverse: Array, radius: float, margin: float) -> int:
    """Whether there is the margin by an inverse (6, 6) whose rotations are scaled here, in place."""
    for axis in range(3, 6):
        for leg in range(6):
            inverse[axis, leg] *= radius
    return int(margin_by_norms(inverse, margin))
