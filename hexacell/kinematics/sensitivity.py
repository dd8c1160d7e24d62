"""Sensitivity of a pose to joint variables and parameters, and its distance from a singularity; batched.

The constraints ``c(x, q, p) = 0`` define the pose x as a function of the joint variables q and the
parameters p. By the implicit function theorem

    dx/dq = -J^-1 dc/dq,    dx/dp = -J^-1 dc/dp,    J = dc/dx.

The distance from a singularity is the smallest singular value s of J, with rotations scaled by the
platform's mean radius. Whether s is at least m is decided without a singular value decomposition for most
poses. With A = J^-1, ``1/s = ||A||_2``, and the Frobenius norm bounds it for a 6 x 6 matrix:

    ||A||_F / sqrt(6) <= ||A||_2 <= ||A||_F.

With the Gramian ``M = A A^T``, ``||A||_2 = ||M^2||_2^(1/4)``, which gives the closer bounds

    ||M^2||_F^(1/4) / 6^(1/8) <= ||A||_2 <= ||M^2||_F^(1/4).

Only poses between these bounds need the decomposition. Source: Golub and Van Loan, Matrix Computations,
4th ed. 2013 (norms, singular values).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.forward import assembly_mode
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import ConstraintDerivatives, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask


def pose_jacobian(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> Array:
    """Derivatives (n, 6, 6) of the constraints by the ball's position, mm, and the rotation vector, rad."""
    return mechanism.residual_and_jacobian(geometry, poses, joints)[1]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Derivatives of a pose by the joint variables (n, 6, 6) and the parameters (n, 6, P).

    Rows are the ball's position, mm, then the rotation vector in the base frame, rad. ``mode`` (n,) is the
    assembly mode.
    """

    joints: Array
    parameters: Array
    mode: Array

    def __getitem__(self, rows: NDArray[np.intp]) -> Sensitivity:
        return Sensitivity(self.joints[rows], self.parameters[rows], self.mode[rows])


def pose_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array
) -> Sensitivity:
    """Implicit derivatives ``-J_pose^-1 J`` at n poses that close the mechanism."""
    linear = mechanism.derivatives(geometry, poses, joints)
    inverse, mode = inverse_and_mode(linear.pose)
    by_constraints = -inverse
    return Sensitivity(
        joints=by_constraints * linear.joints[..., None, :],
        parameters=_by_parameters(mechanism, by_constraints, linear),
        mode=mode,
    )


def position_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array
) -> tuple[Array, Array]:
    """Derivatives of the ball's position: (n, 3, P) by the parameters, (n, 3, 6) by the joint variables."""
    linear = mechanism.derivatives(geometry, poses, joints)
    by_constraints = -inverse_and_mode(linear.pose)[0][:, :3]
    return _by_parameters(mechanism, by_constraints, linear), by_constraints * linear.joints[..., None, :]


def inverse_and_mode(pose_jacobian: Array) -> tuple[Array, Array]:
    """Inverses (n, 6, 6) of pose Jacobians (n, 6, 6), and their assembly modes (n,).

    Raises:
        LinAlgError: one is exactly singular.
    """
    return np.linalg.inv(pose_jacobian), assembly_mode(pose_jacobian)


def _by_parameters(mechanism: Mechanism, by_constraints: Array, linear: ConstraintDerivatives) -> Array:
    """Derivatives (n, m, P) by the parameters, from those by the constraints (n, m, 6)."""
    products = by_constraints[..., None] * linear.parameters[..., None, :, :]
    flat: Array = products.reshape(*by_constraints.shape[:2], len(mechanism.parameters))
    return np.take(flat, mechanism.parameters.leg_order, axis=-1)


def singularity_margin(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> Array:
    """Smallest singular value (n,) of the dimensionless pose Jacobian; 0 at a singularity.

    Rotations are scaled by the platform's mean radius. With the value 0.1 there is a motion of the
    platform by 1 mm that changes the six leg lengths by 0.1 mm together (Euclidean norm).
    """
    smallest: Array = np.linalg.svd(_dimensionless(mechanism, geometry, poses, joints), compute_uv=False)[
        ..., -1
    ]
    return smallest


def has_singularity_margin(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array, margin: float
) -> Mask:
    """Whether :func:`singularity_margin` is at least ``margin`` at each of n poses, computed faster."""
    return _has_margin(_dimensionless(mechanism, geometry, poses, joints), margin)


def margin_and_mode(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array, margin: float
) -> tuple[Mask, Array]:
    """:func:`has_singularity_margin`, and the :func:`assembly_mode` of each of n poses."""
    jacobian = _dimensionless(mechanism, geometry, poses, joints)
    return _has_margin(jacobian, margin), assembly_mode(jacobian)


def _has_margin(jacobian: Array, margin: float) -> Mask:
    """Bounds of the smallest singular value by norms of the inverse, see the head of this file."""
    try:
        inverse = np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[..., -1] >= margin)
    return inverse_has_margin(inverse, margin)


def inverse_has_margin(inverse: Array, margin: float) -> Mask:
    """:func:`has_singularity_margin` by the inverses (n, 6, 6) of dimensionless pose Jacobians."""
    bound = np.linalg.norm(inverse, axis=(-2, -1)) * margin
    has_margin: Mask = bound <= 1.0
    undecided = np.flatnonzero(~has_margin & (bound <= np.sqrt(6.0)))
    gramian = inverse[undecided] @ np.swapaxes(inverse[undecided], -1, -2)
    bound = np.linalg.norm(gramian @ gramian, axis=(-2, -1)) ** 0.25 * margin
    has_margin[undecided] = bound <= 1.0
    undecided = undecided[(bound > 1.0) & (bound <= 6.0**0.125)]
    largest = np.linalg.svd(inverse[undecided], compute_uv=False)[..., 0]
    has_margin[undecided] = largest * margin <= 1.0
    return has_margin


def _dimensionless(
    mechanism: Mechanism, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> Array:
    """The pose Jacobian with rotations scaled by the platform's mean radius."""
    scaled = pose_jacobian(mechanism, geometry, poses, joints).copy()
    scaled[..., 3:] /= np.reshape(mechanism.platform_radius(geometry), (-1, 1, 1))
    return scaled
