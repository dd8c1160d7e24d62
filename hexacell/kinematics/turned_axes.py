"""Axes that are two numbers: the turns about x and y, at once, that put the z axis there.

With the rotation vector ``(a, b, 0)``, ``t = sqrt(a^2 + b^2)``, ``s = sin t / t`` and
``k = (1 - cos t) / t^2`` the axes x, y and z become (Rodrigues)

    u = (1 - b^2 k, a b k, -b s),   w = (a b k, 1 - a^2 k, a s),   axis = (b s, -a s, cos t).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.rotations import Array

SMALL = 1e-6
"""Largest sine that is taken for its angle."""
SERIES = 1e-3
"""Angle, rad, below which the first terms of the series of k's derivative are exact to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnedAxes:
    """Where the turns put x, y and z: unit vectors (..., 3), and derivatives (..., 3, 2) by the turns."""

    u: Array
    w: Array
    axis: Array
    u_by_turns: Array
    w_by_turns: Array
    axis_by_turns: Array

    @classmethod
    def by(cls, turns: Array) -> TurnedAxes:
        """The axes by their turns (..., 2), rad."""
        a, b = turns[..., 0], turns[..., 1]
        angle = np.hypot(a, b)
        s, k = np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
        # ``ds/da = a s_rate`` and ``dk/da = a k_rate``, likewise by b.
        is_small = angle < SERIES
        squared = np.where(is_small, 1.0, angle) ** 2
        s_rate = np.where(is_small, -1.0 / 3.0 + angle**2 / 30.0, (np.cos(angle) - s) / squared)
        k_rate = np.where(is_small, -1.0 / 12.0 + angle**2 / 180.0, (s - 2.0 * k) / squared)
        return cls(
            u=np.stack([1.0 - b * b * k, a * b * k, -b * s], axis=-1),
            w=np.stack([a * b * k, 1.0 - a * a * k, a * s], axis=-1),
            axis=np.stack([b * s, -a * s, np.cos(angle)], axis=-1),
            u_by_turns=_rows(
                (-b * b * a * k_rate, -2.0 * b * k - b**3 * k_rate),
                (b * k + a * a * b * k_rate, a * k + a * b * b * k_rate),
                (-a * b * s_rate, -s - b * b * s_rate),
            ),
            w_by_turns=_rows(
                (b * k + a * a * b * k_rate, a * k + a * b * b * k_rate),
                (-2.0 * a * k - a**3 * k_rate, -a * a * b * k_rate),
                (s + a * a * s_rate, a * b * s_rate),
            ),
            axis_by_turns=_rows(
                (a * b * s_rate, s + b * b * s_rate),
                (-s - a * a * s_rate, -a * b * s_rate),
                (-a * s, -b * s),
            ),
        )


def turns_of(axes: Array) -> Array:
    """The turns (..., 2), rad, of unit vectors (..., 3); of -z that about x."""
    x, y, z = np.moveaxis(axes, -1, 0)
    across = np.hypot(x, y)
    is_vertical = across < SMALL
    factor = np.where(is_vertical, 1.0, np.arctan2(across, z) / np.where(is_vertical, 1.0, across))
    a = np.where(is_vertical & (z < 0.0), np.pi, -y * factor)
    return np.stack([a, x * factor], axis=-1)


def _rows(*rows: tuple[Array, Array]) -> Array:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
