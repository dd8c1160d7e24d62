"""Damped Newton's method, pose by pose, compiled; see :mod:`hexacell.kinematics.forward`."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.compiled.closure import constraints
from hexacell.kinematics.compiled.matrices import compiled, eliminate, turn
from hexacell.kinematics.rotations import Array, Mask


@compiled
def newton(
    base: Array,
    platform: Array,
    lengths: Array,
    is_quadratic: bool,
    positions: Array,
    rotations: Array,
    modes: Array,
    tolerance: float,
    max_steps: int,
    largest_contraction: float,
    largest_translation: float,
    largest_rotation: float,
    found: Mask,
) -> bool:
    """Move n poses in place to where their legs close, and fill ``found`` (n,).

    ``modes`` (n,) are those required; 0 for that of the start. Arrays of the closure have n rows, or one
    for all. Returns false if an exactly singular Jacobian was met, where the result is not complete.
    """
    error, jacobian, factors = np.empty(6), np.empty((6, 6)), np.empty((6, 6))
    step = np.empty((6, 1))
    for row in range(len(positions)):
        own_base = base[row if len(base) > 1 else 0]
        own_platform = platform[row if len(platform) > 1 else 0]
        own_lengths = lengths[row if len(lengths) > 1 else 0]
        position, rotation = positions[row], rotations[row]
        largest = constraints(
            own_base, own_platform, own_lengths, is_quadratic, position, rotation, error, jacobian
        )
        mode, contracts, first = modes[row], True, np.inf
        if mode == 0.0:
            mode = _mode(jacobian, factors, step)
        for taken in range(max_steps):
            if not largest >= tolerance:
                break
            factors[:] = jacobian
            for leg in range(6):
                step[leg, 0] = -error[leg]
            if eliminate(factors, step) == 0.0:
                return False
            size = _shorten(step[:, 0], largest_translation, largest_rotation)
            if largest_contraction < np.inf and taken < 2:
                contracts = contracts and size <= (1.0 if taken == 0 else largest_contraction * first)
                first = size
            for axis in range(3):
                position[axis] += step[axis, 0]
            turn(rotation, step[3:, 0])
            largest = constraints(
                own_base, own_platform, own_lengths, is_quadratic, position, rotation, error, jacobian
            )
        if largest < tolerance:
            found[row] = contracts and _mode(jacobian, factors, step) == mode
    return True


@compiled
def _mode(jacobian: Array, factors: Array, right: Array) -> float:
    """The sign of the determinant; overwrites ``factors`` (6, 6) and ``right`` (6, m)."""
    factors[:] = jacobian
    return float(np.sign(eliminate(factors, right)))


@compiled
def _shorten(step: Array, largest_translation: float, largest_rotation: float) -> float:
    """Shorten a step (6,) in place to the largest translation and rotation; returns its share of them."""
    translation = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    rotation = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
    size = max(translation / largest_translation, rotation / largest_rotation)
    for axis in range(6):
        step[axis] /= max(1.0, size)
    return float(size)
