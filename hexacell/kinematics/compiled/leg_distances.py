"""Smallest distances of legs, compiled; see :mod:`hexacell.kinematics.legs`."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.compiled.matrices import compiled
from hexacell.kinematics.rotations import Array


@compiled
def smallest_distance(starts: Array, ends: Array, parallel: float) -> float:
    """Of any two of six legs from ``starts`` to ``ends`` (6, 3), mm."""
    nearest = np.inf
    for leg in range(5):
        for other in range(leg + 1, 6):
            squared = _squared_distance(starts[leg], ends[leg], starts[other], ends[other], parallel)
            if not squared >= nearest:  # not a number too
                nearest = squared
    return float(np.sqrt(nearest))


@compiled
def smallest_distances(starts: Array, ends: Array, parallel: float, smallest: Array) -> None:
    """Fill ``smallest`` (n,), mm, of any two of six legs from ``starts`` to ``ends`` (n, 6, 3)."""
    for row in range(len(starts)):
        smallest[row] = smallest_distance(starts[row], ends[row], parallel)


@compiled
def _squared_distance(
    start: Array, end: Array, other_start: Array, other_end: Array, parallel: float
) -> float:
    a = e = b = c = f = 0.0
    for axis in range(3):
        along, other = end[axis] - start[axis], other_end[axis] - other_start[axis]
        between = start[axis] - other_start[axis]
        a, e, b = a + along * along, e + other * other, b + along * other
        c, f = c + along * between, f + other * between
    determinant = a * e - b * b
    first = 0.0 if determinant <= parallel * a * e else (b * f - c * e) / determinant
    first = min(max(first, 0.0), 1.0)
    second = min(max((b * first + f) / e, 0.0), 1.0)
    first = min(max((b * second - c) / a, 0.0), 1.0)
    squared = 0.0
    for axis in range(3):
        apart = start[axis] - other_start[axis] + first * (end[axis] - start[axis])
        apart -= second * (other_end[axis] - other_start[axis])
        squared += apart * apart
    return squared
