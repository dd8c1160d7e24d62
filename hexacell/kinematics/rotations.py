"""Rotation matrices from angles and from rotation vectors, and axes turned about x and y; batched.

Convention: a pose's angles a, b, c turn about the fixed axes x, y, z in that order,
``R = Rz(c) Ry(b) Rx(a)`` (LinuxCNC's ``genhexkins`` and the paper's a, b, g).

**Axes** are two numbers: the turns about x and y, at once, that put the z axis there.
With the rotation vector ``(a, b, 0)``, ``t = sqrt(a^2 + b^2)``, ``s = sin t / t`` and
``k = (1 - cos t) / t^2`` the axes x, y and z become (Rodrigues)

    u = (1 - b^2 k, a b k, -b s),   w = (a b k, 1 - a^2 k, a s),   axis = (b s, -a s, cos t).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating[Any]]
"""Real numbers; docstrings give the shapes."""

Mask = NDArray[np.bool_]

SMALL = 1e-6
"""Largest sine that is taken for its angle."""
SERIES = 1e-3
"""Angle, rad, below which the first terms of the series of k's derivative are exact to rounding."""

SMALLEST = 1e-300
"""Square of an angle that changes no larger one."""

_IDENTITY = np.eye(3)


def from_angles(angles: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of the angles a, b, c (..., 3), rad."""
    angles = np.asarray(angles, dtype=float)
    cosines, sines = np.cos(angles), np.sin(angles)
    ca, cb, cc = cosines[..., 0], cosines[..., 1], cosines[..., 2]
    sa, sb, sc = sines[..., 0], sines[..., 1], sines[..., 2]
    rotation = np.empty((*angles.shape, 3))
    rotation[..., 0, 0] = cc * cb
    rotation[..., 0, 1] = cc * sb * sa - sc * ca
    rotation[..., 0, 2] = cc * sb * ca + sc * sa
    rotation[..., 1, 0] = sc * cb
    rotation[..., 1, 1] = sc * sb * sa + cc * ca
    rotation[..., 1, 2] = sc * sb * ca - cc * sa
    rotation[..., 2, 0] = -sb
    rotation[..., 2, 1] = cb * sa
    rotation[..., 2, 2] = cb * ca
    return rotation


def to_angles(rotation: ArrayLike) -> Array:
    """Angles a, b, c (..., 3), rad, with b in [-pi/2, pi/2]; at b = +-pi/2, c is set to 0."""
    r = np.asarray(rotation, dtype=float)
    cos_b = np.hypot(r[..., 0, 0], r[..., 1, 0])
    b = np.arctan2(-r[..., 2, 0], cos_b)
    c = np.where(cos_b < 1e-12, 0.0, np.arctan2(r[..., 1, 0], r[..., 0, 0]))
    # The rotation c is removed first: near b = +-pi/2 it is ill determined, and its error must not enter a.
    sine, cosine = np.sin(c), np.cos(c)
    a = np.arctan2(sine * r[..., 0, 2] - cosine * r[..., 1, 2], cosine * r[..., 1, 1] - sine * r[..., 0, 1])
    angles = np.empty(r.shape[:-1])
    angles[..., 0], angles[..., 1], angles[..., 2] = a, b, c
    return angles


def skew(vector: ArrayLike) -> Array:
    """Cross-product matrices (..., 3, 3): ``skew(u) @ v = u x v``."""
    u = np.asarray(vector, dtype=float)
    matrix = np.zeros((*u.shape, 3))
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        matrix[..., k, j] = u[..., axis]
        matrix[..., j, k] = -u[..., axis]
    return matrix


_SKEW = skew(_IDENTITY).reshape(3, 9)
"""Cross-product matrices in rows: one product is faster than six assignments."""


def from_vector(vector: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad (Rodrigues' formula)."""
    vector = np.asarray(vector, dtype=float)
    squared = np.einsum("...i,...i->...", vector, vector)[..., None]
    # Without a turn the quotient of two very small numbers is 1, as it should be.
    half = np.sqrt(0.25 * squared + SMALLEST)
    quotient = np.sin(half) / half
    quadratic = 0.5 * quotient**2
    flat = (quotient * np.cos(half) * vector) @ _SKEW
    rotation: Array = flat.reshape(*vector.shape, 3)
    rotation += (quadratic * vector)[..., :, None] * vector[..., None, :]
    rotation += (1.0 - quadratic * squared)[..., None] * _IDENTITY
    return rotation


def to_vector(rotation: ArrayLike) -> Array:
    """Rotation vectors (..., 3), rad, with an angle in [0, pi)."""
    r = np.asarray(rotation, dtype=float)
    axis = 0.5 * np.stack(
        [r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axis, axis=-1)
    cosine = 0.5 * (np.trace(r, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 1.0)
    return axis * scale[..., None]


@dataclass(frozen=True, eq=False)
class TurnedAxes:
    """Where ``turns`` (..., 2), rad, put x, y and z: unit vectors (..., 3)."""

    turns: Array
    u: Array
    w: Array
    axis: Array

    @classmethod
    def by(cls, turns: Array) -> "TurnedAxes":
        """The axes by their turns (..., 2), rad."""
        a, b, angle, s, k = _sine_and_cosine(turns)
        return cls(
            turns,
            u=np.stack([1.0 - b * b * k, a * b * k, -b * s], axis=-1),
            w=np.stack([a * b * k, 1.0 - a * a * k, a * s], axis=-1),
            axis=np.stack([b * s, -a * s, np.cos(angle)], axis=-1),
        )

    @cached_property
    def by_turns(self) -> tuple[Array, Array, Array]:
        """Derivatives (..., 3, 2) of u, w and axis by the turns."""
        a, b, angle, s, k = _sine_and_cosine(self.turns)
        # ``ds/da = a s_rate`` and ``dk/da = a k_rate``, likewise by b.
        is_small = angle < SERIES
        squared = np.where(is_small, 1.0, angle) ** 2
        s_rate = np.where(is_small, -1.0 / 3.0 + angle**2 / 30.0, (np.cos(angle) - s) / squared)
        k_rate = np.where(is_small, -1.0 / 12.0 + angle**2 / 180.0, (s - 2.0 * k) / squared)
        of_u = (
            (-b * b * a * k_rate, -2.0 * b * k - b**3 * k_rate),
            (b * k + a * a * b * k_rate, a * k + a * b * b * k_rate),
            (-a * b * s_rate, -s - b * b * s_rate),
        )
        of_w = (
            of_u[1],
            (-2.0 * a * k - a**3 * k_rate, -a * a * b * k_rate),
            (s + a * a * s_rate, a * b * s_rate),
        )
        of_axis = (
            (a * b * s_rate, s + b * b * s_rate),
            (-s - a * a * s_rate, -a * b * s_rate),
            (-a * s, -b * s),
        )
        u, w, axis = (
            np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) for rows in (of_u, of_w, of_axis)
        )
        return u, w, axis


def _sine_and_cosine(turns: Array) -> tuple[Array, Array, Array, Array, Array]:
    """a, b, t, s and k of the formulas above."""
    a, b = turns[..., 0], turns[..., 1]
    angle = np.hypot(a, b)
    return a, b, angle, np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2


def turns_of(axes: Array) -> Array:
    """The turns (..., 2), rad, of unit vectors (..., 3); of -z that about x."""
    x, y, z = np.moveaxis(axes, -1, 0)
    across = np.hypot(x, y)
    is_vertical = across < SMALL
    factor = np.where(is_vertical, 1.0, np.arctan2(across, z) / np.where(is_vertical, 1.0, across))
    a = np.where(is_vertical & (z < 0.0), np.pi, -y * factor)
    return np.stack([a, x * factor], axis=-1)
