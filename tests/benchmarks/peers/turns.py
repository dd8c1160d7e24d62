"""Rotation vectors, for peers that bring no library for them."""

from __future__ import annotations

import numpy as np

from tests.benchmarks.peers.interface import Array


def skew(vectors: Array) -> Array:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*vectors.shape, 3)


def exponential(vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    k = skew(vectors)
    half = np.sinc(angle / (2.0 * np.pi))
    result: Array = np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * half**2 * (k @ k)
    return result


def left_jacobian(vector: Array) -> Array:
    """(3, 3) from a change of a rotation vector (3,) to the turn in the base frame that it makes."""
    angle = float(np.linalg.norm(vector))
    k = skew(vector)
    if angle < 1e-6:
        return np.eye(3) + 0.5 * k
    linear = (1.0 - np.cos(angle)) / angle**2
    square = (angle - np.sin(angle)) / angle**3
    result: Array = np.eye(3) + linear * k + square * (k @ k)
    return result
