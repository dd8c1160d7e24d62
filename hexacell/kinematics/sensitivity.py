"""Sensitivity of a pose to joint variables and parameters, and its distance from a singularity; batched.

The constraints ``c(x, q, p) = 0`` define the pose x as a function of the joint variables q and the
parameters p. By the implicit function theorem

    dx/dq = -J^-1 dc/dq,    dx/dp = -J^-1 dc/dp,    J = dc/dx.

A free parameter stands for one parameter of a constraint, or for several: those that a frame convention
makes equal, and those that constraints share. Its derivative is the sum of theirs: most are one number of
one leg, so that they are picked and few are added.

The distance from a singularity is the smallest singular value s of J, with rotations scaled by the
platform's mean radius. Whether s is at least m is decided without a singular value decomposition for most
poses. With A = J^-1, ``1/s = ||A||_2``, and the Frobenius norm bounds it for a 6 x 6 matrix:

    ||A||_F / sqrt(6) <= ||A||_2 <= ||A||_F.

With the Gramian ``M = A A^T``, ``||A||_2 = ||M^2||_2^(1/4)``, which gives the closer bounds

    ||M^2||_F^(1/4) / 6^(1/8) <= ||A||_2 <= ||M^2||_F^(1/4).

Only poses between these bounds need the decomposition.

In all functions a ``geometry`` is one for all of n ``poses``, or one for each where a batch is allowed, in
the convention's frames; ``joints`` (n, J) are the joint variables there, in their unit. ``coordinates`` is
``POSITION`` or ``POSE``, of which m derivatives follow, and a ``margin`` the least singular value,
dimensionless.

Source: Golub and Van Loan, Matrix Computations, 4th ed. 2013 (norms, singular values).
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.kinematics.forward import assembly_mode
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.mechanism import ConstraintDerivatives, Mechanism
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array, Mask

POSITION = 3
POSE = 6
"""How many of a pose's coordinates are wanted: the ball's position, or all."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeSensitivity(Batch):
    """Derivatives of a pose by the joint variables (n, m, J) and the free parameters (n, m, p).

    Rows are the ball's position, mm, then, if m is 6, the rotation vector in the base frame, rad.
    ``constraints`` (n, 6, 6) are the derivatives of the constraints by the pose.
    """

    joints: Array
    free: Array
    constraints: Array

    @property
    def mode(self) -> Array:
        """The assembly mode (n,) of each pose."""
        return assembly_mode(self.constraints)


def free_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array, coordinates: int = POSE
) -> FreeSensitivity:
    """Derivatives of n poses that close the mechanism, by joints and free parameters.

    Raises:
        LinAlgError: a pose is exactly at a singularity.
    """
    linear = mechanism.derivatives(geometry, poses, joints)
    return _by_inverse(mechanism, linear, np.linalg.inv(linear.pose), coordinates)


def sensitivity_and_margin(
    mechanism: Mechanism,
    geometry: Geometry,
    poses: PoseBatch,
    joints: Array,
    coordinates: int,
    margin: float,
) -> tuple[FreeSensitivity, Mask]:
    """:func:`free_sensitivity`, and at which of n poses (n,) there is a ``margin`` to singularities.

    One inverse of the pose Jacobian serves both. Exactly at a singularity, where there is no margin, the
    derivatives mean nothing.
    """
    linear = mechanism.derivatives(geometry, poses, joints)
    is_regular = np.ones(len(joints), dtype=bool)
    try:
        inverse = np.linalg.inv(linear.pose)
    except np.linalg.LinAlgError:
        is_regular = np.linalg.det(linear.pose) != 0.0
        linear = replace(linear, pose=np.where(is_regular[:, None, None], linear.pose, np.eye(6)))
        inverse = np.linalg.inv(linear.pose)
    radius = float(mechanism.platform_radius(geometry))
    scaled = np.concatenate([inverse[:, :3], radius * inverse[:, 3:]], axis=1)
    sensitivity = _by_inverse(mechanism, linear, inverse, coordinates)
    return sensitivity, _inverse_has_margin(scaled, margin) & is_regular


def _by_inverse(
    mechanism: Mechanism, linear: ConstraintDerivatives, inverse: Array, coordinates: int
) -> FreeSensitivity:
    """The sensitivity by the inverses (n, 6, 6) of the pose Jacobians."""
    by_constraints = -inverse[:, :coordinates]
    products = by_constraints[..., None] * linear.parameters[..., None, :, :]
    all_places = products.shape[2] * products.shape[3]  # of no pose numpy cannot infer it
    of_each = products.reshape(*products.shape[:2], all_places)
    convention = mechanism.convention
    by_free: Array = np.take(of_each, mechanism.parameters.first_places[convention.free_rows], axis=-1)
    for place, column in convention.further_places:
        by_free[..., column] += of_each[..., place]
    by_legs = by_constraints[..., : linear.joints.shape[-1]]
    return FreeSensitivity(by_legs * linear.joints[..., None, :], by_free, linear.pose)


def singularity_margin(
    mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array
) -> Array:
    """Smallest singular value (n,) of the dimensionless pose Jacobian; 0 at a singularity.

    Rotations are scaled by the platform's mean radius. With the value 0.1 there is a motion of the
    platform by 1 mm that changes the six leg lengths by 0.1 mm together (Euclidean norm).
    """
    jacobian = _dimensionless(mechanism, geometry, poses, joints)
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[..., -1])


def has_singularity_margin(
    mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array, margin: float
) -> Mask:
    """Whether :func:`singularity_margin` (n,) is at least a margin, computed faster."""
    return _has_margin(_dimensionless(mechanism, geometry, poses, joints), margin)


def margin_and_mode(
    mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array, margin: float
) -> tuple[Mask, Array]:
    """:func:`has_singularity_margin`, and the :func:`assembly_mode` (n,) of each of n poses."""
    jacobian = _dimensionless(mechanism, geometry, poses, joints)
    return _has_margin(jacobian, margin), assembly_mode(jacobian)


def _has_margin(jacobian: Array, margin: float) -> Mask:
    try:
        inverse = np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[..., -1] >= margin)
    return _inverse_has_margin(inverse, margin)


def _inverse_has_margin(inverse: Array, margin: float) -> Mask:
    """Whether there is the margin, by the inverses (n, 6, 6) of dimensionless pose Jacobians.

    The bounds are those at the head of this file.
    """
    bound = np.linalg.norm(inverse, axis=(-2, -1)) * margin
    has_margin: Mask = bound <= 1.0
    undecided = np.flatnonzero(~has_margin & (bound <= np.sqrt(6.0)))
    if not len(undecided):
        return has_margin
    gramian = inverse[undecided] @ np.swapaxes(inverse[undecided], -1, -2)
    bound = np.linalg.norm(gramian @ gramian, axis=(-2, -1)) ** 0.25 * margin
    has_margin[undecided] = bound <= 1.0
    undecided = undecided[(bound > 1.0) & (bound <= 6.0**0.125)]
    largest = np.linalg.svd(inverse[undecided], compute_uv=False)[..., 0]
    has_margin[undecided] = largest * margin <= 1.0
    return has_margin


def _dimensionless(mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array) -> Array:
    """The pose Jacobian with rotations scaled by the platform's mean radius."""
    scaled = mechanism.residual_and_jacobian(geometry, poses, joints)[1].copy()
    scaled[..., 3:] /= np.reshape(mechanism.platform_radius(geometry), (-1, 1, 1))
    return scaled
