"""Sensitivity of a pose to the free parameters: what estimates and choices of poses are made of; batched.

A free parameter stands for one parameter of a leg, or for several that a frame convention makes equal. Its
derivative is the sum of theirs: most are one number of one leg, so that they are picked and few are added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import ConstraintDerivatives, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import inverse_and_mode, inverse_has_margin

POSITION = 3
POSE = 6
"""How many of a pose's coordinates are wanted: the ball's position, or all."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeSensitivity:
    """Derivatives of a pose by the joint variables (n, m, 6) and the free parameters (n, m, p).

    Rows are the ball's position, mm, then, if m is 6, the rotation vector in the base frame, rad. ``mode``
    (n,) is the assembly mode.
    """

    joints: Array
    free: Array
    mode: Array

    def __getitem__(self, rows: NDArray[np.intp]) -> FreeSensitivity:
        return FreeSensitivity(self.joints[rows], self.free[rows], self.mode[rows])


def free_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array, coordinates: int = POSE
) -> FreeSensitivity:
    """Implicit derivatives at n poses that close the mechanism; see :mod:`.sensitivity`.

    Raises:
        LinAlgError: a pose is exactly at a singularity.
    """
    linear = mechanism.derivatives(geometry, poses, joints)
    inverse, mode = inverse_and_mode(linear.pose)
    return _by_inverse(mechanism, linear, inverse, mode, coordinates)


def sensitivity_and_margin(
    mechanism: Mechanism,
    geometry: Geometry,
    poses: PoseBatch,
    joints: Array,
    coordinates: int,
    margin: float,
) -> tuple[FreeSensitivity, Mask]:
    """:func:`free_sensitivity`, and at which of n poses there is a ``margin`` to singularities.

    One inverse of the pose Jacobian tells both. Exactly at a singularity, where there is no margin, the
    derivatives mean nothing.
    """
    linear = mechanism.derivatives(geometry, poses, joints)
    radius = float(mechanism.platform_radius(geometry))
    try:
        inverse, mode = inverse_and_mode(linear.pose)
        is_regular = np.ones(len(joints), dtype=bool)
    except np.linalg.LinAlgError:
        is_regular = np.linalg.det(linear.pose) != 0.0
        linear = replace(linear, pose=np.where(is_regular[:, None, None], linear.pose, np.eye(6)))
        inverse, mode = inverse_and_mode(linear.pose)
    has_margin = inverse_has_margin(_dimensionless(inverse, radius), margin)
    return _by_inverse(mechanism, linear, inverse, mode, coordinates), has_margin & is_regular


def _dimensionless(inverse: Array, radius: float) -> Array:
    """The inverses (n, 6, 6) of pose Jacobians with rotations scaled by a radius, mm."""
    return np.concatenate([inverse[:, :3], radius * inverse[:, 3:]], axis=1)


def _by_inverse(
    mechanism: Mechanism, linear: ConstraintDerivatives, inverse: Array, mode: Array, coordinates: int
) -> FreeSensitivity:
    """The sensitivity by the inverses (n, 6, 6) of the pose Jacobians."""
    by_constraints = -inverse[:, :coordinates]
    by_joints = by_constraints * linear.joints[..., None, :]
    return FreeSensitivity(by_joints, _by_free(mechanism, by_constraints, linear), mode)


def _by_free(mechanism: Mechanism, by_constraints: Array, linear: ConstraintDerivatives) -> Array:
    """Derivatives (n, m, p) by the free parameters, from those by the constraints (n, m, 6)."""
    products = by_constraints[..., None] * linear.parameters[..., None, :, :]
    of_legs = products.reshape(*by_constraints.shape[:2], len(mechanism.parameters))
    order, convention = mechanism.parameters.leg_order, mechanism.convention
    by_free: Array = np.take(of_legs, order[convention.free_rows()], axis=-1)
    for row, column in convention.dependent:
        by_free[..., column] += of_legs[..., order[row]]
    return by_free
