"""A robot at some poses, and what small errors of its legs and joints do to these."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import ConstraintDerivatives, Guides, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, eq=False)
class Placement:
    """A robot at n poses, with the joint variables (n, J), mm, that close its geometry there."""

    mechanism: Mechanism
    geometry: Geometry
    poses: PoseBatch
    joints: Array

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def each_leg(self) -> Array:
        """One unit of each of the legs (J, J)."""
        return np.eye(self.joints.shape[1])

    @cached_property
    def derivatives(self) -> ConstraintDerivatives:
        """Derivatives of the constraints."""
        return self.mechanism.derivatives(self.geometry, self.poses, self.joints)

    @cached_property
    def guides(self) -> Guides | None:
        """The guides of the sliders, if there are any."""
        return self.mechanism.guides(self.geometry, self.poses, self.joints)

    @cached_property
    def by_constraints(self) -> Array:
        """Derivatives (n, 6, 6) of the pose, mm and rad, by errors of the constraints, mm."""
        return np.asarray(-np.linalg.inv(self.derivatives.pose))

    def by_joints(self, errors: Array) -> Array:
        """Errors of the poses (n, 6, k) by errors (n, J, k), mm, of the joint variables."""
        return self.by_legs(self.derivatives.joints[..., None] * errors)

    def by_legs(self, errors: Array) -> Array:
        """Errors of the poses (n, 6, k) by errors (n, J, k), mm, of the legs' constraints."""
        return np.asarray(self.by_constraints[..., : errors.shape[1]] @ errors)

    def as_joints(self, errors: Array) -> Array:
        """Changes of the joint variables (n, J) that do what errors (n, J), mm, of the legs do.

        A leg at its dead point has none.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            changes = errors / self.derivatives.joints
        return np.nan_to_num(changes, posinf=0.0, neginf=0.0)

    def by_parameters(self, changes: Array) -> Array:
        """Errors of the poses (n, 6, k) by changes (P, k) of the parameters."""
        of_each = self.mechanism.parameters.by_constraint(changes)
        errors = np.einsum("nic,ick->nik", self.derivatives.parameters, of_each)
        return np.asarray(self.by_constraints @ errors)


@dataclass(frozen=True, eq=False)
class RecordPlacement(Placement):
    """A robot at n records, and what the gauges saw there.

    Attributes:
        deviations: (n, 3), mm, along the base axes.
        gauges: (3, 3), columns: measuring directions of the gauges.
        directions: (n, J) from which side each joint arrived, 1 or -1; 0 where that is not known.
        warmer: (n, 7), K, legs and base than the geometry's; what that does is not in the joint variables.
    """

    deviations: Array
    gauges: Array
    directions: Array
    warmer: Array


@dataclass(frozen=True, slots=True, eq=False)
class Weight:
    """How a weight acts on the platform.

    Attributes:
        direction: (3,), a unit vector in the convention's base frame.
        centre_mm: where it acts (3,), in its platform frame; None: in the middle of the platform's joints.
        beside_mm: (3,) how far from there.
    """

    direction: Array
    centre_mm: Array | None = None
    beside_mm: Array = field(default_factory=lambda: np.zeros(3))


def leg_forces(placement: Placement, weight: Weight) -> Array:
    """Forces (n, J) of the legs, N, by a weight of one newton on the platform; tension is positive."""
    poses = placement.poses
    direction, arms = weight.direction, poses.rotations @ weight.beside_mm
    if weight.centre_mm is None:
        legs = placement.mechanism.legs(placement.geometry, poses, placement.joints)
        arms = arms + legs.platform_joints.mean(axis=1) - poses.positions
    else:
        arms = arms + poses.rotations @ weight.centre_mm
    wrench = np.concatenate([np.broadcast_to(direction, arms.shape), np.cross(arms, direction)], axis=-1)
    # Virtual work: J^T t = w, with -J^-1 at hand.
    by_legs = placement.by_constraints[..., : placement.joints.shape[1]]
    return np.asarray(-np.einsum("nji,nj->ni", by_legs, wrench))
