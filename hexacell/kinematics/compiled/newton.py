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
    error, jacobian, system, step = np.empty(6), np.empty((6, 6)), np.empty((6, 7)), np.empty(6)
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
            mode = _mode(jacobian, system)
        for taken in range(max_steps):
            if not largest >= tolerance:
                break
            if _solve(jacobian, error, system, step) == 0.0:
                return False
            size = _shorten(step, largest_translation, largest_rotation)
            if largest_contraction < np.inf and taken < 2:
                contracts = contracts and size <= (1.0 if taken == 0 else largest_contraction * first)
                first = size
            for axis in range(3):
                position[axis] += step[axis]
            turn(rotation, step[3:])
            largest = constraints(
                own_base, own_platform, own_lengths, is_quadratic, position, rotation, error, jacobian
            )
        if largest < tolerance:
            found[row] = contracts and _mode(jacobian, system) == mode
    return True


@compiled
def modes_at(
    base: Array,
    platform: Array,
    lengths: Array,
    is_quadratic: bool,
    positions: Array,
    rotations: Array,
    modes: Array,
) -> None:
    """Fill ``modes`` (n,) of n poses."""
    error, jacobian, system = np.empty(6), np.empty((6, 6)), np.empty((6, 7))
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
        modes[row] = _mode(jacobian, system)


@compiled
def _solve(jacobian: Array, error: Array, system: Array, step: Array) -> float:
    """Fill the Newton ``step`` (6,); returns the determinant. Overwrites ``system`` (6, 7)."""
    for leg in range(6):
        for axis in range(6):
            system[leg, axis] = jacobian[leg, axis]
        system[leg, 6] = -error[leg]
    determinant = eliminate(system)
    for axis in range(6):
        step[axis] = system[axis, 6]
    return float(determinant)


@compiled
def _mode(jacobian: Array, system: Array) -> float:
    """The sign of the determinant; overwrites ``system`` (6, 7)."""
    for leg in range(6):
        for axis in range(6):
            system[leg, axis] = jacobian[leg, axis]
        system[leg, 6] = 0.0
    return float(np.sign(eliminate(system)))


@compiled
def _shorten(step: Array, largest_translation: float, largest_rotation: float) -> float:
    """Shorten a step (6,) in place to the largest translation and rotation; returns its share of them."""
    translation = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    rotation = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
    size = max(translation / largest_translation, rotation / largest_rotation)
    for axis in range(6):
        step[axis] /= max(1.0, size)
    return float(size)
