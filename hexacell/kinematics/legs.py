"""The legs in space: how far passive joints are turned, and how near legs come to each other; batched.

A passive joint (ball joint or universal joint) lets a leg turn within a cone about an axis that is fixed to
what carries the joint: the slider, which does not turn, at one end, and the platform at the other. The
distance of two legs is that of the segments between their joints (Lumelsky, Information Processing Letters
21, 1985).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from hexacell.kinematics.rotations import Array, Mask

PAIRS = np.array(list(combinations(range(6), 2)))
"""Of legs, counted from 0."""

ROUNDING = 1e-9
"""Of an angle, rad, or a length, mm: a pose at a limit is within it."""

PARALLEL = 1e-12
"""Squared sine of the angle between two legs below which they are parallel."""


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """The legs at n poses, in the base frame.

    Attributes:
        base_joints: (n, 6, 3) passive joints at the base's end: those on the sliders, mm.
        platform_joints: (n, 6, 3), mm.
        rotations: (n, 3, 3) platform frame to base frame.
    """

    base_joints: Array
    platform_joints: Array
    rotations: Array

    @property
    def directions(self) -> Array:
        """Unit vectors (n, 6, 3) from the platform to the base, in the base frame."""
        vectors = self.base_joints - self.platform_joints
        directions: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
        return directions

    @property
    def directions_in_platform(self) -> Array:
        """The same unit vectors in the platform frame."""
        return self.directions @ self.rotations

    def smallest_distance(self) -> Array:
        """Between any two legs (n,), mm: of the lines in their middles."""
        ends = self.base_joints, self.platform_joints
        first, second = ([joints[:, PAIRS[:, side]] for joints in ends] for side in (0, 1))
        smallest: Array = segment_distances(*first, *second).min(axis=-1)
        return smallest


def segment_distances(start: Array, end: Array, other_start: Array, other_end: Array) -> Array:
    """The smallest distances (...,) of segments from others; each end is (..., 3)."""
    along, other, between = end - start, other_end - other_start, start - other_start
    a, e, b = _dot(along, along), _dot(other, other), _dot(along, other)
    c, f = _dot(along, between), _dot(other, between)
    determinant = a * e - b * b
    is_parallel = determinant <= PARALLEL * a * e
    first = np.where(is_parallel, 0.0, (b * f - c * e) / np.where(is_parallel, 1.0, determinant))
    first = np.clip(first, 0.0, 1.0)
    second = np.clip((b * first + f) / e, 0.0, 1.0)
    # The nearest point of the first segment to that of the other one, which may be its end.
    first = np.clip((b * second - c) / a, 0.0, 1.0)
    apart = between + first[..., None] * along - second[..., None] * other
    distances: Array = np.linalg.norm(apart, axis=-1)
    return distances


def angles_between(vectors: Array, axes: Array) -> Array:
    """Angles (...,), rad, between unit vectors (..., 3) and unit ``axes`` (..., 3)."""
    return np.arccos(np.clip(_dot(vectors, axes), -1.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class LegLimits:
    """What passive joints and legs allow.

    Attributes:
        base_axes: (6, 3) unit vectors in the base frame about which the base's passive joints turn.
        platform_axes: (6, 3) those of the platform's joints, in the platform frame.
        base_cones: (6,) largest angles of the legs from these axes, rad.
        platform_cones: (6,) those at the platform, rad.
        distance_mm: smallest distance of two legs.
    """

    base_axes: Array
    platform_axes: Array
    base_cones: Array
    platform_cones: Array
    distance_mm: float

    def spare_angles(self, legs: Legs) -> Array:
        """Angles (n, 2, 6), rad, that passive joints have left, at the base and at the platform."""
        at_base = self.base_cones - angles_between(legs.directions, self.base_axes)
        at_platform = self.platform_cones - angles_between(legs.directions_in_platform, self.platform_axes)
        return np.stack([at_base, at_platform], axis=-2)

    def margins(self, legs: Legs) -> Array:
        """By how much n poses keep these limits, (n, m), negative beyond them.

        The spare angles of the passive joints, rad, then the legs' spare distance, mm, if it has a limit.
        """
        angles = self.spare_angles(legs).reshape(-1, 12)
        if self.distance_mm == 0.0:
            return angles
        return np.column_stack([angles, legs.smallest_distance() - self.distance_mm])

    def margins_for(self, turn: float, radius_mm: float) -> Array:
        """Margins (m,) that hold should a platform of some radius turn by an angle, rad."""
        turns = np.full(12, turn)
        return turns if self.distance_mm == 0.0 else np.append(turns, turn * radius_mm)

    def including(self, legs: Legs, wanted: Array | float = 0.0) -> LegLimits:
        """These limits, widened where the margins at one pose (1) are less than wanted (m,)."""
        missing = np.maximum(0.0, wanted - self.margins(legs)[0] + ROUNDING)
        return replace(
            self,
            base_cones=self.base_cones + missing[:6],
            platform_cones=self.platform_cones + missing[6:12],
            distance_mm=max(0.0, self.distance_mm - float(missing[12:].sum())),
        )

    def are_kept(self, legs: Legs, wanted: Array | float = 0.0) -> Mask:
        """At which of n poses, with at least the wanted margins (m,)."""
        return np.asarray((self.margins(legs) >= wanted).all(axis=-1))


def _dot(one: Array, other: Array) -> Array:
    product: Array = np.einsum("...i,...i->...", one, other)
    return product
