"""Poses, and changes of the frames they are in: numbers for files and people, arrays for computations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import Array, Mask

Index = slice | NDArray[np.intp] | Mask | list[int]
"""Which poses of a batch. With two axes a pair: which poses of a line, and which lines."""

AXES = "xyzabc"
"""Axes of a controller, in the order of a pose's six numbers."""

SAME_MM = 1e-6
SAME_ANGLE = float(np.radians(1e-6))
"""Poses that differ by less are the same, converted between frames, or written and read again."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A platform pose as it appears in files, controller commands and text.

    ``x, y, z`` is the ball's centre in the base frame, mm; ``a, b, c`` are the angles about the
    fixed axes x, y, z in that order, deg: ``R = Rz(c) Ry(b) Rx(a)``.
    """

    x: float
    y: float
    z: float
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0

    @classmethod
    def of(cls, position: Array, rotation: Array) -> Pose:
        """The pose of a ball centre (3,), mm, and a rotation matrix (3, 3)."""
        angles = np.degrees(rotations.to_angles(rotation))
        return cls(*(float(value) for value in (*position, *angles)))

    @property
    def position(self) -> Array:
        """The ball's centre (3,), mm."""
        return np.array([self.x, self.y, self.z])

    @property
    def rotation(self) -> Array:
        """The rotation matrix (3, 3) from the platform frame to the base frame."""
        return rotations.from_angles(np.radians([self.a, self.b, self.c]))

    @property
    def level(self) -> Pose:
        """The position without tilt and turn."""
        return Pose(self.x, self.y, self.z)

    def angle_to(self, other: Pose) -> float:
        """By how much the platform turns from one to the other, rad."""
        return float(np.linalg.norm(rotations.to_vector(other.rotation @ self.rotation.T)))

    def as_tuple(self) -> tuple[float, float, float, float, float, float]:
        """``(x, y, z, a, b, c)``, mm and deg."""
        return (self.x, self.y, self.z, self.a, self.b, self.c)

    def __str__(self) -> str:
        coordinates = zip("XYZABC", self.as_tuple(), strict=True)
        return " ".join(f"{axis}{value:z.3f}" for axis, value in coordinates)


class Batch:
    """Some of the rows, and those of several in one: a base of dataclasses whose fields all have n rows."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    def __getitem__(self, rows: Index | tuple[Index | int, Index | int]) -> Self:
        # A list: poses are taken from batches so often that a generator takes a percent of a decision.
        return type(self)(*[getattr(self, name)[rows] for name in self.__dataclass_fields__])

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """The rows of several in one."""
        several = list(parts)
        columns: list[Any] = []
        for name in cls.__dataclass_fields__:
            column = [getattr(part, name) for part in several]
            is_array = isinstance(column[0], np.ndarray)
            columns.append(np.concatenate(column) if is_array else type(column[0]).joined(column))
        return cls(*columns)


@dataclass(frozen=True, slots=True, eq=False)
class PoseBatch(Batch):
    """Poses as arrays, for computations: n of them, or (m, n), which is m poses along each of n lines.

    Attributes:
        positions: ball centres (n, 3), mm.
        rotations: rotation matrices (n, 3, 3), platform frame to base frame.
    """

    positions: Array
    rotations: Array

    @classmethod
    def of(cls, poses: Iterable[Pose]) -> PoseBatch:
        """The batch of some poses."""
        numbers = np.array([pose.as_tuple() for pose in poses], dtype=float).reshape(-1, 6)
        return cls(numbers[:, :3], rotations.from_angles(np.radians(numbers[:, 3:])))

    @classmethod
    def at(cls, position: ArrayLike, orientations: Array) -> PoseBatch:
        """One position (3,), mm, in several orientations (n, 3, 3)."""
        return cls(np.broadcast_to(np.asarray(position, dtype=float), (len(orientations), 3)), orientations)

    def with_rows(self, rows: Index | tuple[Index | int, Index | int], poses: PoseBatch) -> PoseBatch:
        """A copy in which ``poses`` replace those in some rows."""
        positions, orientations = self.positions.copy(), self.rotations.copy()
        positions[rows], orientations[rows] = poses.positions, poses.rotations
        return PoseBatch(positions, orientations)

    def in_shape(self, *shape: int) -> PoseBatch:
        """The poses in their order, in another shape: ``-1`` for one axis, ``-1, n`` for n lines."""
        return PoseBatch(self.positions.reshape(*shape, 3), self.rotations.reshape(*shape, 3, 3))

    def pose(self, row: int) -> Pose:
        """The pose in a row, in mm and deg."""
        return Pose.of(self.positions[row], self.rotations[row])

    def is_same(self, other: PoseBatch) -> Mask:
        """Which of n poses are another one (1), up to rounding."""
        distance = np.abs(self.positions - other.positions).max(axis=-1)
        angle = np.abs(self.rotations - other.rotations).max(axis=(-2, -1))
        return np.asarray((distance < SAME_MM) & (angle < SAME_ANGLE))

    def tilts(self) -> Array:
        """Angles (n,), rad, between the platform's z axis and the base's."""
        return np.arccos(np.clip(self.rotations[:, 2, 2], -1.0, 1.0))

    def numbers(self) -> Array:
        """x, y, z, mm, and a, b, c, deg, of n poses (n, 6), as a controller gets them."""
        return np.concatenate([self.positions, np.degrees(rotations.to_angles(self.rotations))], axis=-1)

    def turns(self) -> Array:
        """Angles (n,), rad, in (-pi, pi], by which the platform is turned about its normal, then tilted."""
        r = self.rotations
        return np.arctan2(r[:, 1, 0] - r[:, 0, 1], r[:, 0, 0] + r[:, 1, 1])


@dataclass(frozen=True, slots=True, eq=False)
class FrameTransform:
    """The change from one choice of base and platform frames to another, for the same machine.

    A position becomes ``base @ (P - origin)``, a rotation ``base @ R @ platform.T``.
    """

    base: Array
    origin: Array
    platform: Array

    def then(self, further: FrameTransform) -> FrameTransform:
        """This change and a further one in one."""
        origin = self.origin + self.base.T @ further.origin
        return FrameTransform(further.base @ self.base, origin, further.platform @ self.platform)

    def poses(self, poses: PoseBatch) -> PoseBatch:
        """Poses in the new frames."""
        return PoseBatch(
            (poses.positions - self.origin) @ self.base.T,
            # Products of small matrices are twice as fast in one layout.
            self.base @ poses.rotations @ np.ascontiguousarray(self.platform.T),
        )

    def deviations(self, deviations: Array) -> Array:
        """Differences of positions (n, 3), mm, in the new base frame."""
        return deviations @ self.base.T

    def inverse(self) -> FrameTransform:
        """The opposite change."""
        base, platform = np.ascontiguousarray(self.base.T), np.ascontiguousarray(self.platform.T)
        return FrameTransform(base, -self.base @ self.origin, platform)


SAME_FRAMES = FrameTransform(np.eye(3), np.zeros(3), np.eye(3))
