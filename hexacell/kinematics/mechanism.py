"""What a mechanism is: one scalar constraint a leg, its derivatives, and its frame convention."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet
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
        parameters: (n, 6, c): leg i depends on its own c numbers alone, in the order of the kinds.
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
    parameters: ParameterSet
    zero: tuple[str, ...]
    equal: tuple[tuple[str, ...], ...]

    @cache  # noqa: B019 - a convention lives as long as its mechanism's class
    def basis(self) -> Array:
        """The (P, p) matrix from free parameters to all of them; its entries are 0 and 1."""
        leader = {name: group[0] for group in self.equal for name in group}
        free = self.free_names()
        matrix = np.zeros((len(self.parameters), len(free)))
        for row, name in enumerate(self.parameters.names):
            if name not in self.zero:
                matrix[row, free.index(leader.get(name, name))] = 1.0
        matrix.setflags(write=False)
        return matrix

    def free_names(self) -> tuple[str, ...]:
        """Names of the free parameters; one that stands for several carries the first name."""
        followers = {name for group in self.equal for name in group[1:]}
        return tuple(
            name for name in self.parameters.names if name not in self.zero and name not in followers
        )

    @cache  # noqa: B019
    def free_rows(self) -> NDArray[np.intp]:
        """Where the free parameters stand in a vector (P,) of all."""
        return self.parameters.rows(self.free_names())

    def free_parameters(self, geometry: Geometry) -> Array:
        """The free parameters (p,) of a geometry that obeys the convention, mm."""
        return geometry.vector[self.free_rows()]

    def geometry(self, free: Array) -> Geometry:
        """The geometry of free parameters (p,)."""
        return Geometry(self.parameters, self.basis() @ free)

    def display_name(self, name: str) -> str:
        """A parameter for people: ``l3`` is "leg 3 length", ``B6x`` is "B6 x".

        The first of several parameters that are equal stands for all: "B2/B3/B5 z".
        """
        group = next((group for group in self.equal if group[0] == name), (name,))
        members: list[GeometricParameter] = [
            self.parameters.parameters[row] for row in self.parameters.rows(group).tolist()
        ]
        first = members[0]
        joints = "/".join(f"{member.kind.symbol}{member.leg}" for member in members)
        return first.kind.display_name(first.leg, first.component, joints)


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


class Mechanism(Protocol):
    """A six-legged parallel mechanism. Everything is batched over n poses; nothing raises."""

    name: str
    parameters: ParameterSet
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

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The same machine in other frames."""
        ...

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """The platform's mean radius about the ball, mm: what scales rotations; (n,) of a batch."""
        ...
