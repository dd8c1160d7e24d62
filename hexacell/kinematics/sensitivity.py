"""How a pose moves with joint variables and parameters, and how near it is to a singularity; batched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.forward import assembly_mode
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import ConstraintDerivatives, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask


def pose_jacobian(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> Array:
    """Derivatives (n, 6, 6) of the constraints by position, mm, and rotation vector, rad."""
    return mechanism.residual_and_jacobian(geometry, poses, joints)[1]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """How a pose moves when the joint variables or the geometry change.

    Rows are the ball's position, mm, then the rotation vector in the base frame, rad.

    Attributes:
        joints: (n, 6, 6).
        parameters: (n, 6, P).
        mode: (n,), see :func:`assembly_mode`.
    """

    joints: Array
    parameters: Array
    mode: Array


def pose_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array
) -> Sensitivity:
    """Implicit derivatives ``-J_pose^-1 J`` at n poses that close the mechanism."""
    linear = mechanism.derivatives(geometry, poses, joints)
    by_legs = -np.linalg.inv(linear.pose)
    return Sensitivity(
        joints=by_legs * linear.joints[..., None, :],
        parameters=_by_parameters(mechanism, by_legs, linear),
        mode=assembly_mode(linear.pose),
    )


def position_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array
) -> tuple[Array, Array]:
    """Of the ball's position alone: (n, 3, P) by the parameters, (n, 3, 6) by the joint variables."""
    linear = mechanism.derivatives(geometry, poses, joints)
    by_legs = -np.linalg.inv(linear.pose)[:, :3]
    return _by_parameters(mechanism, by_legs, linear), by_legs * linear.joints[..., None, :]


def _by_parameters(mechanism: Mechanism, by_legs: Array, linear: ConstraintDerivatives) -> Array:
    """How something (n, m, 6) that depends on the legs depends on the parameters (n, m, P)."""
    of_legs = by_legs[..., None] * linear.parameters[..., None, :, :]
    flat: Array = of_legs.reshape(*by_legs.shape[:2], len(mechanism.parameters))
    return np.take(flat, mechanism.parameters.leg_order, axis=-1)


def singularity_margin(mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
    """Smallest singular value (n,) of the dimensionless pose Jacobian; 0 at a singularity.

    Rotations are scaled by the platform's mean radius, so that a value of 0.1 says: some unit
    motion of the platform changes no leg by more than a tenth of it.
    """
    smallest: Array = np.linalg.svd(_dimensionless(mechanism, geometry, poses, joints), compute_uv=False)[
        ..., -1
    ]
    return smallest


def has_singularity_margin(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array, margin: float
) -> Mask:
    """Whether :func:`singularity_margin` is at least ``margin`` at each of n poses, in less time."""
    return _keeps_margin(_dimensionless(mechanism, geometry, poses, joints), margin)


def margin_and_mode(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array, margin: float
) -> tuple[Mask, Array]:
    """:func:`has_singularity_margin`, and the :func:`assembly_mode` of each of n poses."""
    jacobian = _dimensionless(mechanism, geometry, poses, joints)
    return _keeps_margin(jacobian, margin), assembly_mode(jacobian)


def _keeps_margin(jacobian: Array, margin: float) -> Mask:
    """By norms of the inverse, which bound the smallest singular value from both sides.

    Those of its Gramian's square bound it closer; only what lies between needs the value itself.
    """
    try:
        inverse = np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[..., -1] >= margin)
    largest = np.linalg.norm(inverse, axis=(-2, -1)) * margin
    keeps: Mask = largest <= 1.0
    doubtful = np.flatnonzero(~keeps & (largest <= np.sqrt(6.0)))
    gramian = inverse[doubtful] @ np.swapaxes(inverse[doubtful], -1, -2)
    largest = np.linalg.norm(gramian @ gramian, axis=(-2, -1)) ** 0.25 * margin
    keeps[doubtful] = largest <= 1.0
    doubtful = doubtful[(largest > 1.0) & (largest <= 6.0**0.125)]
    keeps[doubtful] = np.linalg.svd(jacobian[doubtful], compute_uv=False)[..., -1] >= margin
    return keeps


def _dimensionless(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> Array:
    """The pose Jacobian with rotations scaled by the platform's mean radius."""
    scaled = pose_jacobian(mechanism, geometry, poses, joints).copy()
    scaled[..., 3:] /= np.reshape(mechanism.platform_radius(geometry), (-1, 1, 1))
    return scaled
