"""Singularity margins, pose by pose, compiled; see :mod:`hexacell.kinematics.sensitivity`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.compiled.closure import constraints
from hexacell.kinematics.compiled.matrices import compiled, eliminate
from hexacell.kinematics.rotations import Array

BELOW, ABOVE, UNDECIDED = 0, 1, 2


@compiled
def margins_and_modes(
    base: Array,
    platform: Array,
    lengths: Array,
    is_quadratic: bool,
    positions: Array,
    rotations: Array,
    radii: Array,
    margin: float,
    decided: NDArray[np.int8],
    modes: Array,
) -> None:
    """Fill ``decided`` (n,), whether n poses have the margin as far as norms tell, and ``modes`` (n,).

    ``radii`` (n,) or (1,) scale rotations; arrays of the closure have n rows, or one for all.
    """
    error, jacobian, system = np.empty(6), np.empty((6, 6)), np.empty((6, 12))
    for row in range(len(positions)):
        constraints(
            base[row if len(base) > 1 else 0],
            platform[row if len(platform) > 1 else 0],
            lengths[row if len(lengths) > 1 else 0],
            is_quadratic,
            positions[row],
            rotations[row],
            error,
            jacobian,
        )
        _beside_identity(jacobian, radii[row if len(radii) > 1 else 0], system)
        determinant = eliminate(system)
        modes[row] = np.sign(determinant)
        decided[row] = margin_by_norms(system[:, 6:], margin) if determinant != 0.0 else UNDECIDED


@compiled
def _beside_identity(jacobian: Array, radius: float, system: Array) -> None:
    """Fill ``system`` (6, 12): the dimensionless Jacobian, and the identity, which becomes its inverse."""
    for leg in range(6):
        for axis in range(3):
            system[leg, axis] = jacobian[leg, axis]
            system[leg, 3 + axis] = jacobian[leg, 3 + axis] / radius
        for axis in range(6):
            system[leg, 6 + axis] = 1.0 if axis == leg else 0.0


@compiled
def margin_by_norms(inverse: Array, margin: float) -> int:
    """Whether the smallest singular value is at least ``margin``, by two norms of the inverse."""
    squares = 0.0
    for row in range(6):
        for column in range(6):
            squares += inverse[row, column] * inverse[row, column]
    bound = np.sqrt(squares) * margin
    if bound <= 1.0:
        return ABOVE
    if not bound <= np.sqrt(6.0):
        return BELOW
    own = np.ascontiguousarray(inverse)
    gramian = own @ own.T
    squared = gramian @ gramian
    bound = np.sum(squared * squared) ** 0.125 * margin
    if bound <= 1.0:
        return ABOVE
    return UNDECIDED if bound <= 6.0**0.125 else BELOW
