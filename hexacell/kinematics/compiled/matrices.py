"""Small dense matrices for compiled loops: elimination with partial pivoting; and the compiler itself."""

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
def exchange(rows: Array, one: int, other: int) -> None:
    """Exchange two rows of a matrix."""
    for column in range(rows.shape[1]):
        kept = rows[one, column]
        rows[one, column] = rows[other, column]
        rows[other, column] = kept


@compiled
def subtract(rows: Array, factor: float, one: int, other: int) -> None:
    """Subtract a multiple of one row of a matrix from another."""
    for column in range(rows.shape[1]):
        rows[other, column] -= factor * rows[one, column]


@compiled
def _largest_below(matrix: Array, pivot: int) -> int:
    """The row of the largest entry of a column, from its diagonal downward."""
    largest = pivot
    for row in range(pivot + 1, len(matrix)):
        if abs(matrix[row, pivot]) > abs(matrix[largest, pivot]):
            largest = row
    return largest


@compiled
def eliminate(matrix: Array, right: Array) -> float:
    """Solve in place ``matrix`` (n, n) for all columns of ``right`` (n, m); returns the determinant.

    Where it is 0 the right side is meaningless.
    """
    size = len(matrix)
    determinant = 1.0
    for pivot in range(size):
        largest = _largest_below(matrix, pivot)
        if matrix[largest, pivot] == 0.0:
            return 0.0
        if largest != pivot:
            determinant = -determinant
            exchange(matrix, pivot, largest)
            exchange(right, pivot, largest)
        determinant *= matrix[pivot, pivot]
        for row in range(pivot + 1, size):
            factor = matrix[row, pivot] / matrix[pivot, pivot]
            subtract(matrix, factor, pivot, row)
            subtract(right, factor, pivot, row)
    for row in range(size - 1, -1, -1):
        for other in range(row + 1, size):
            subtract(right, matrix[row, other], other, row)
        for column in range(right.shape[1]):
            right[row, column] /= matrix[row, row]
    return determinant


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
