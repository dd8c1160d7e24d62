"""Inverse and forward kinematics, Jacobians and singularity margin of any mechanism, batched.

Forward kinematics has many solutions (assembly modes). The one wanted is found by continuation:
start at a pose that belongs to a known geometry and known joint variables, and follow it while
both change into the ones asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import ReachError
from hexacell.geometry import Geometries, Geometry
from hexacell.mechanisms.base import Branch, Linearisation, Mechanism
from hexacell.newton import (
    CONVERGED_MM,
    ON_THE_WAY_MM,
    STAGE_STEPS,
    Forward,
    assembly_mode,
    moved,
    newton,
)
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

__all__ = [
    "Forward",
    "Sensitivity",
    "assembly_mode",
    "follow",
    "forward",
    "inverse",
    "keeps_margin",
    "margin_and_mode",
    "moved",
    "pose_jacobian",
    "position_sensitivity",
    "sensitivity",
    "singularity_margin",
]

CONTINUATION_STAGES = (2, 8, 32)


def inverse(mechanism: Mechanism, geometry: Geometry, branch: Branch, poses: Poses) -> Array:
    """Joint variables (n, 6), mm, of n poses.

    Raises:
        ReachError: a leg is too short or too long for a pose; the message names both.
    """
    joints = mechanism.inverse(geometry, branch, poses)
    if np.isnan(joints).any():
        row, leg = np.argwhere(np.isnan(joints))[0]
        raise ReachError(f"leg {leg + 1} cannot reach the pose {poses.pose(row)}")
    return joints


def forward(
    mechanism: Mechanism,
    geometry: Geometry | Geometries,
    joints: Array,
    start: Poses,
    *,
    mode: Array | None = None,
    close_mm: float = CONVERGED_MM,
) -> Forward:
    """Poses of n joint vectors (n, 6), mm, by damped Newton steps from nearby poses.

    ``geometry`` is one for all of them, or one for each. ``mode`` (n,) is the sign of the Jacobian's
    determinant to be kept; by default that at ``start``. Legs may be ``close_mm`` too short or long.
    """
    if mode is None:
        mode = assembly_mode(mechanism.closure(geometry, start, joints)[1])
    return newton(mechanism, geometry, joints, start, mode, close_mm)


def follow(
    mechanism: Mechanism,
    geometry: Geometry,
    joints: Array,
    *,
    start: Poses,
    start_geometry: Geometry,
    start_joints: Array,
    tries: Sequence[int] = CONTINUATION_STAGES,
) -> Forward:
    """Poses of n joint vectors (n, 6), mm, continued from poses that are known exactly.

    ``start`` closes ``start_geometry`` at ``start_joints`` (n, 6). Geometry and joint variables go
    to the ones asked for together, in as many stages as the first of ``tries`` says, then, where that
    was not enough, in as many as the next. A stage that ends on the other side of a singularity is
    a failure, not a solution.
    """
    poses = start
    found = np.zeros(len(joints), dtype=bool)
    for stages in tries:
        rows = np.flatnonzero(~found)
        if not len(rows):
            break
        ends = (start_joints[rows], joints[rows])
        result = _staged(mechanism, (start_geometry, geometry), ends, start[rows], stages)
        poses = _replace(poses, rows, result.poses)
        found[rows] = result.found
    return Forward(poses, found)


def pose_jacobian(
    mechanism: Mechanism, geometry: Geometry | Geometries, poses: Poses, joints: Array
) -> Array:
    """Derivatives (n, 6, 6) of the constraints by position, mm, and rotation vector, rad."""
    return mechanism.closure(geometry, poses, joints)[1]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """How a pose moves when the joint variables or the geometry change.

    Rows are the ball's position, mm, then the rotation vector in the base frame, rad.

    Attributes:
        joints: (n, 6, 6).
        parameters: (n, 6, 42).
        mode: (n,), see :func:`assembly_mode`.
    """

    joints: Array
    parameters: Array
    mode: Array


def sensitivity(mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array) -> Sensitivity:
    """Implicit derivatives ``-J_pose^-1 J`` at n poses that close the mechanism."""
    linear = mechanism.linearise(geometry, poses, joints)
    by_legs = -np.linalg.inv(linear.pose)
    return Sensitivity(
        joints=by_legs * linear.joints[..., None, :],
        parameters=_by_parameters(by_legs, linear),
        mode=assembly_mode(linear.pose),
    )


def position_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array
) -> tuple[Array, Array]:
    """Of the ball's position alone: (n, 3, 42) by the parameters, (n, 3, 6) by the joint variables."""
    linear = mechanism.linearise(geometry, poses, joints)
    by_legs = -np.linalg.inv(linear.pose)[:, :3]
    return _by_parameters(by_legs, linear), by_legs * linear.joints[..., None, :]


def _by_parameters(by_legs: Array, linear: Linearisation) -> Array:
    """How something (n, m, 6) that depends on the legs depends on the parameters (n, m, 42)."""
    each = by_legs[..., None] * linear.parameters[..., None, :, :]
    kinds = [each[..., part] for part in (slice(3), slice(3, 6), slice(6, 7))]
    flat = [kind.reshape(*by_legs.shape[:2], 6 * kind.shape[-1]) for kind in kinds]
    return np.concatenate(flat, axis=-1)


def singularity_margin(mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array) -> Array:
    """Smallest singular value (n,) of the dimensionless pose Jacobian; 0 at a singularity.

    Rotations are scaled by the platform's mean radius, so that a value of 0.1 says: some unit
    motion of the platform changes no leg by more than a tenth of it.
    """
    smallest: Array = np.linalg.svd(_dimensionless(mechanism, geometry, poses, joints), compute_uv=False)[
        ..., -1
    ]
    return smallest


def keeps_margin(
    mechanism: Mechanism, geometry: Geometry | Geometries, poses: Poses, joints: Array, margin: float
) -> Mask:
    """Whether :func:`singularity_margin` is at least ``margin`` at each of n poses, in less time."""
    return _keeps_margin(_dimensionless(mechanism, geometry, poses, joints), margin)


def margin_and_mode(
    mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array, margin: float
) -> tuple[Mask, Array]:
    """:func:`keeps_margin`, and the :func:`assembly_mode` of each of n poses."""
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
    mechanism: Mechanism, geometry: Geometry | Geometries, poses: Poses, joints: Array
) -> Array:
    """The pose Jacobian with rotations scaled by the platform's mean radius."""
    scaled = pose_jacobian(mechanism, geometry, poses, joints).copy()
    radius = np.mean(np.linalg.norm(geometry.B, axis=-1), axis=-1)
    scaled[..., 3:] /= np.reshape(radius, (-1, 1, 1))
    return scaled


def _staged(
    mechanism: Mechanism,
    geometries: tuple[Geometry, Geometry],
    joints: tuple[Array, Array],
    start: Poses,
    stages: int,
) -> Forward:
    poses = start
    rows = np.arange(len(start))
    mode = assembly_mode(mechanism.closure(geometries[0], start, joints[0])[1])
    for stage in range(1, stages + 1):
        fraction = stage / stages
        geometry = geometries[0].toward(geometries[1], fraction)
        now = (1.0 - fraction) * joints[0][rows] + fraction * joints[1][rows]
        close_mm = CONVERGED_MM if stage == stages else ON_THE_WAY_MM
        result = newton(mechanism, geometry, now, poses[rows], mode[rows], close_mm, STAGE_STEPS)
        poses = _replace(poses, rows, result.poses)
        # Those that failed are not led on: they would cost more than all the others.
        rows = rows[result.found]
    found = np.zeros(len(start), dtype=bool)
    found[rows] = True
    return Forward(poses, found)


def _replace(poses: Poses, rows: NDArray[np.intp], new: Poses) -> Poses:
    positions, orientation = poses.positions.copy(), poses.rotations.copy()
    positions[rows], orientation[rows] = new.positions, new.rotations
    return Poses(positions, orientation)
