"""The legs in space: their directions, and how near they come to each other; batched.

The distance of two legs is that of the segments between their joints (Lumelsky, Information Processing
Letters 21, 1985).
"""

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import UsageError
from hexacell.kinematics.rotations import Array, Mask

BLOCK = 128
"""Poses computed at once: larger arrays get fresh memory from the system each time, which takes longer."""

PARALLEL = 1e-12
"""Squared sine of the angle between two legs below which they are parallel."""

CLOSEST_JOINTS_MM = 1e-6
"""Joints that are closer than that are at one place."""


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """The legs at n poses, in the base frame.

    Attributes:
        base_joints: (n, J, 3) passive joints at the base's end: those on the sliders or cranks, mm.
        platform_joints: (n, J, 3), mm.
        rotations: (n, 3, 3) platform frame to base frame.
        carriers: (n, J, 3, 3) to the base frame from what carries each leg's joint at the base's end; None
            where that does not turn.
    """

    base_joints: Array
    platform_joints: Array
    rotations: Array
    carriers: Array | None = None

    def __getitem__(self, rows: Mask) -> "Legs":
        carriers = None if self.carriers is None else self.carriers[rows]
        return Legs(self.base_joints[rows], self.platform_joints[rows], self.rotations[rows], carriers)

    @property
    def directions(self) -> Array:
        """Unit vectors (n, J, 3) from the platform to the base, in the base frame."""
        vectors = self.base_joints - self.platform_joints
        return vectors / np.sqrt(_dot(vectors, vectors))[..., None]

    def in_carriers(self, directions: Array) -> Array:
        """Vectors (n, J, 3) of the legs in the frames of what carries their joints on the base."""
        if self.carriers is None:
            return directions
        return np.asarray(np.einsum("nlij,nli->nlj", self.carriers, directions))

    def smallest_distance(self) -> Array:
        """Between any two legs (n,), mm: of the lines in their middles."""
        # Coordinates come first: sums over three numbers at the end of an array take several times as long.
        start = np.ascontiguousarray(self.base_joints.T)
        end = np.ascontiguousarray(self.platform_joints.T)
        first, second = _pairs(start.shape[1])
        smallest = np.empty(len(self.base_joints))
        for row in range(0, len(smallest), BLOCK):
            some = np.s_[..., row : row + BLOCK]
            ends = (one[some][:, legs] for legs in (first, second) for one in (start, end))
            smallest[some] = segment_distances(*ends).min(axis=0)
        return smallest


@cache
def _pairs(legs: int) -> NDArray[np.intp]:
    """Pairs (2, k) of legs, counted from 0."""
    return np.array(list(combinations(range(legs), 2))).T


def segment_distances(start: Array, end: Array, other_start: Array, other_end: Array) -> Array:
    """The smallest distances (...,) of segments from others, mm; each end is (3, ...)."""
    along, other, between = end - start, other_end - other_start, start - other_start
    a, e, b = _product(along, along), _product(other, other), _product(along, other)
    c, f = _product(along, between), _product(other, between)
    determinant = a * e - b * b
    is_parallel = determinant <= PARALLEL * a * e
    first = np.where(is_parallel, 0.0, (b * f - c * e) / np.where(is_parallel, 1.0, determinant))
    first = _clipped(first, 0.0, 1.0)
    second = _clipped((b * first + f) / e, 0.0, 1.0)
    # The nearest point of the first segment to that of the other one, which may be its end.
    first = _clipped((b * second - c) / a, 0.0, 1.0)
    apart = between + first * along - second * other
    return np.sqrt(_product(apart, apart))


def _product(one: Array, other: Array) -> Array:
    """Scalar products of vectors (3, ...)."""
    return np.asarray(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])


def _clipped(values: Array, least: float, most: float) -> Array:
    """As np.clip, which takes several times as long for a few numbers."""
    return np.minimum(np.maximum(values, least), most)


def angles_between(vectors: Array, axes: Array) -> Array:
    """Angles (...,), rad, from 0 to pi, between unit vectors (..., 3)."""
    return np.arccos(_clipped(_dot(vectors, axes), -1.0, 1.0))


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", one, other))


def by_pose(b: Array, n: Array) -> Array:
    """Derivatives ``[n, b x n]`` (n, J, 6) of the legs' lengths by position, then rotation vector.

    Args:
        b: (n, J, 3) from the ball to the platform joints, in the base frame, mm.
        n: (n, J, 3) direction of each leg towards the platform, of length 1 where the leg closes.
    """
    jacobian = np.empty((*n.shape[:-1], 6))
    jacobian[..., :3] = n
    # np.cross would cost as much as the rest of a Newton step.
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    nx, ny, nz = n[..., 0], n[..., 1], n[..., 2]
    jacobian[..., 3] = by * nz - bz * ny
    jacobian[..., 4] = bz * nx - bx * nz
    jacobian[..., 5] = bx * ny - by * nx
    return jacobian


def axes_through(first: Array, second: Array, third: Array, part: str) -> Array:
    """The axes (3, 3), in rows, that three joints (3,), mm, of a ``part``, base or platform, fix.

    x points from the first to the second, y toward the third, and z is normal to the plane of all three.

    Raises:
        UsageError: the joints are in one line, or two of them at one place.
    """
    if (width := np.linalg.norm(second - first)) < CLOSEST_JOINTS_MM:
        raise UsageError(f"two {part} joints that fix the frame are at one place")
    x = (second - first) / width
    z = np.cross(x, third - first)
    if (height := np.linalg.norm(z)) < CLOSEST_JOINTS_MM:
        raise UsageError(f"the {part} joints that fix the frame are in one line")
    z /= height
    return np.stack([x, np.cross(z, x), z])
