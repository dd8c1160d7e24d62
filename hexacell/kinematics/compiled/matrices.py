"""Six linear equations and rotations for compiled loops; and the compiler itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba
import numpy as np

from hexacell.kinematics.rotations import Array

FunctionType = TypeVar("FunctionType", bound=Callable[..., object])


def compiled(function: FunctionType) -> FunctionType:
    """A function as machine code, kept on disk; divisions by zero give what they give in numpy."""
    return cast("FunctionType", numba.njit(cache=True, error_model="numpy")(function))


@compiled
def _exchange(rows: Array, one: int, other: int, first: int) -> None:
    """Exchange two rows of a matrix from a column on."""
    for column in range(first, rows.shape[1]):
        kept = rows[one, column]
        rows[one, column] = rows[other, column]
        rows[other, column] = kept


@compiled
def _largest_below(matrix: Array, pivot: int) -> int:
    """The row of the largest entry of a column, from its diagonal downward."""
    largest = pivot
    for row in range(pivot + 1, 6):
        if abs(matrix[row, pivot]) > abs(matrix[largest, pivot]):
            largest = row
    return largest


@compiled
def _substitute(system: Array) -> None:
    """Solve in place where elimination has left an upper triangle."""
    for row in range(5, -1, -1):
        for column in range(6, system.shape[1]):
            rest = system[row, column]
            for other in range(row + 1, 6):
                rest -= system[row, other] * system[other, column]
            system[row, column] = rest / system[row, row]


@compiled
def eliminate(system: Array) -> float:
    """Solve in place six equations for m right sides, ``system`` (6, 6 + m); returns the determinant.

    The solutions are where the right sides were; they are meaningless where the determinant is 0.
    """
    determinant = 1.0
    for pivot in range(6):
        largest = _largest_below(system, pivot)
        if system[largest, pivot] == 0.0:
            return 0.0
        if largest != pivot:
            determinant = -determinant
            _exchange(system, pivot, largest, pivot)
        determinant *= system[pivot, pivot]
        inverse = 1.0 / system[pivot, pivot]
        for row in range(pivot + 1, 6):
            factor = system[row, pivot] * inverse
            for column in range(pivot + 1, system.shape[1]):
                system[row, column] -= factor * system[pivot, column]
    _substitute(system)
    return determinant


@compiled
def invert(matrices: Array, inverses: Array, determinants: Array) -> None:
    """Fill ``inverses`` (n, 6, 6) and ``determinants`` (n,); an inverse is meaningless where that is 0."""
    system = np.empty((6, 12))
    for row in range(len(matrices)):
        for place in range(6):
            for column in range(6):
                system[place, column] = matrices[row, place, column]
                system[place, 6 + column] = 1.0 if column == place else 0.0
        determinants[row] = eliminate(system)
        for place in range(6):
            for column in range(6):
                inverses[row, place, column] = system[place, 6 + column]


@compiled
def turn(rotation: Array, vector: Array) -> None:
    """Turn ``rotation`` (3, 3) in place by a rotation vector (3,), rad, in the base frame."""
    x, y, z = vector
    squared = x * x + y * y + z * z
    half = 0.5 * np.sqrt(squared)
    quotient = np.sin(half) / half if half > 1e-9 else 1.0
    linear, quadratic = quotient * np.cos(half), 0.5 * quotient * quotient
    diagonal = 1.0 - quadratic * squared
    for column in range(3):
        a, b, c = rotation[0, column], rotation[1, column], rotation[2, column]
        along = quadratic * (x * a + y * b + z * c)
        rotation[0, column] = diagonal * a + linear * (y * c - z * b) + along * x
        rotation[1, column] = diagonal * b + linear * (z * a - x * c) + along * y
        rotation[2, column] = diagonal * c + linear * (x * b - y * a) + along * z
