"""What a mechanism is: one scalar constraint a leg, its derivatives, and its frame convention."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np

from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry, GeometryBatch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

Branch = tuple[int, int, int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintDerivatives:
    """First derivatives of the six constraints at n poses, all per mm of leg length.

    Attributes:
        pose: (n, 6, 6) by the ball's position, mm, then by a rotation vector in the base frame,
            rad, applied from the left.
        joints: (n, 6): leg i depends on joint variable i alone.
        parameters: (n, 6, 7): leg i depends on its own S, B and l alone.
    """

    pose: Array
    joints: Array
    parameters: Array


@dataclass(frozen=True, slots=True)
class FrameConvention:
    """Which parameters a choice of frames fixes at zero, and which it makes equal.

    The rules are stated, never found by a rank threshold: with geometry errors the rank of the
    data's Jacobian says something else (``docs/method.md``).
    """

    name: str
    zero: tuple[str, ...]
    equal: tuple[tuple[str, ...], ...]

    @cache  # noqa: B019 - a convention lives as long as its mechanism's class
    def basis(self) -> Array:
        """The (42, p) matrix from free parameters to all of them; its entries are 0 and 1."""
        leader = {name: group[0] for group in self.equal for name in group}
        free = self.free_names()
        matrix = np.zeros((len(PARAMETER_NAMES), len(free)))
        for row, name in enumerate(PARAMETER_NAMES):
            if name not in self.zero:
                matrix[row, free.index(leader.get(name, name))] = 1.0
        matrix.setflags(write=False)
        return matrix

    def free_names(self) -> tuple[str, ...]:
        """Names of the free parameters; one that stands for several carries the first name."""
        followers = {name for group in self.equal for name in group[1:]}
        return tuple(name for name in PARAMETER_NAMES if name not in self.zero and name not in followers)

    def free_parameters(self, geometry: Geometry) -> Array:
        """The free parameters (p,) of a geometry that obeys the convention, mm."""
        rows = [PARAMETER_NAMES.index(name) for name in self.free_names()]
        return geometry.vector()[rows]


@dataclass(frozen=True, slots=True, eq=False)
class FrameTransform:
    """From one choice of frames to another that describes the same machine.

    A position becomes ``base @ (P - origin)``, a rotation ``base @ R @ platform.T``.
    """

    base: Array
    origin: Array
    platform: Array

    def poses(self, poses: PoseBatch) -> PoseBatch:
        """The same poses in the new frames."""
        return PoseBatch(
            (poses.positions - self.origin) @ self.base.T,
            self.base @ poses.rotations @ self.platform.T,
        )

    def deviations(self, deviations: Array) -> Array:
        """The same differences of positions (n, 3), mm, in the new base frame."""
        return deviations @ self.base.T

    def inverse(self) -> FrameTransform:
        """The way back."""
        return FrameTransform(self.base.T, -self.base @ self.origin, self.platform.T)

    def geometry(self, geometry: Geometry) -> Geometry:
        """The same machine in the new frames."""
        return Geometry((geometry.S - self.origin) @ self.base.T, geometry.B @ self.platform.T, geometry.l)


class Mechanism(Protocol):
    """A six-legged parallel mechanism. Everything is batched over n poses; nothing raises."""

    name: str
    convention: FrameConvention

    def constraints(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """How much too long each leg would have to be (n, 6), mm; zero where the machine closes."""
        ...

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """:meth:`constraints` (n, 6) and their derivatives by the pose (n, 6, 6), for Newton's method.

        Of one robot at all poses, or of another at each.
        """
        ...

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """All derivatives of :meth:`constraints`."""
        ...

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6), mm, in closed form; NaN where a leg cannot reach."""
        ...

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """On which of the two solutions of its inverse each leg stands (n, 6): -1 or 1."""
        ...

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """The same machine in the frames of :attr:`convention`, and how to get there."""
        ...
