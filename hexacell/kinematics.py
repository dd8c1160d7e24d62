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

from hexacell import rotations
from hexacell.errors import ReachError
from hexacell.geometry import Geometry
from hexacell.mechanisms.base import Branch, Mechanism
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

CONVERGED_MM = 1e-10
"""Constraints below this count as closed: legs are a metre, and doubles carry 16 digits."""

NEWTON_STEPS = 12
LONGEST_STEP_MM = 60.0
LARGEST_TURN = 0.5
CONTINUATION_STAGES = (2, 8, 32)


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """Poses found by forward kinematics, and which of them can be trusted.

    Attributes:
        poses: n poses; where ``found`` is false, the last iterate.
        found: (n,) bool: converged to rounding, on the assembly mode it started from.
    """

    poses: Poses
    found: Mask


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
    mechanism: Mechanism, geometry: Geometry, joints: Array, start: Poses, *, mode: Array | None = None
) -> Forward:
    """Poses of n joint vectors (n, 6), mm, by damped Newton steps from nearby poses.

    ``mode`` (n,) is the sign of the Jacobian's determinant to be kept; by default that at ``start``.
    """
    if mode is None:
        mode = assembly_mode(mechanism.closure(geometry, start, joints)[1])
    return _newton(mechanism, geometry, joints, start, mode)


def assembly_mode(pose_jacobian: Array) -> Array:
    """The sign (n,) of the determinant of pose Jacobians (n, 6, 6): it changes at a singularity."""
    signs: Array = np.sign(np.linalg.det(pose_jacobian))
    return signs


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


def pose_jacobian(mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array) -> Array:
    """Derivatives (n, 6, 6) of the constraints by position, mm, and rotation vector, rad."""
    return mechanism.linearise(geometry, poses, joints).pose


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
    inverse_jacobian = -np.linalg.inv(linear.pose)
    by_leg = inverse_jacobian[..., None], linear.parameters[..., None, :, :]
    columns = [by_leg[0] * by_leg[1][..., part] for part in (slice(3), slice(3, 6), slice(6, 7))]
    return Sensitivity(
        joints=inverse_jacobian * linear.joints[..., None, :],
        parameters=np.concatenate(
            [part.reshape(len(poses), 6, 6 * part.shape[-1]) for part in columns], axis=-1
        ),
        mode=assembly_mode(linear.pose),
    )


def singularity_margin(mechanism: Mechanism, geometry: Geometry, poses: Poses, joints: Array) -> Array:
    """Smallest singular value (n,) of the dimensionless pose Jacobian; 0 at a singularity.

    Rotations are scaled by the platform's mean radius, so that a value of 0.1 says: some unit
    motion of the platform changes no leg by more than a tenth of it.
    """
    scaled = pose_jacobian(mechanism, geometry, poses, joints).copy()
    scaled[..., 3:] /= np.mean(np.linalg.norm(geometry.B, axis=-1))
    smallest: Array = np.linalg.svd(scaled, compute_uv=False)[..., -1]
    return smallest


def moved(poses: Poses, step: Array) -> Poses:
    """Poses after steps (n, 6): positions, mm, then rotation vectors in the base frame, rad."""
    return Poses(poses.positions + step[..., :3], rotations.from_vector(step[..., 3:]) @ poses.rotations)


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
        result = _newton(mechanism, geometry, now, poses[rows], mode[rows])
        poses = _replace(poses, rows, result.poses)
        # Those that failed are not led on: they would cost more than all the others.
        rows = rows[result.found]
    found = np.zeros(len(start), dtype=bool)
    found[rows] = True
    return Forward(poses, found)


def _newton(mechanism: Mechanism, geometry: Geometry, joints: Array, start: Poses, mode: Array) -> Forward:
    """Newton's method on the pose, each step bounded."""
    poses = start
    error, jacobian = mechanism.closure(geometry, poses, joints)
    for _ in range(NEWTON_STEPS):
        if not np.isfinite(error).all() or np.abs(error).max(initial=0.0) < CONVERGED_MM:
            break
        poses = moved(poses, _step(jacobian, error))
        error, jacobian = mechanism.closure(geometry, poses, joints)
    closed = np.abs(error).max(axis=-1, initial=0.0) < CONVERGED_MM
    return Forward(poses, closed & (assembly_mode(jacobian) == mode))


def _step(jacobian: Array, error: Array) -> Array:
    try:
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = -(np.linalg.pinv(jacobian) @ error[..., None])[..., 0]
    travel = np.linalg.norm(step[..., :3], axis=-1) / LONGEST_STEP_MM
    turn = np.linalg.norm(step[..., 3:], axis=-1) / LARGEST_TURN
    shortened: Array = step / np.maximum(1.0, np.maximum(travel, turn))[..., None]
    return shortened


def _replace(poses: Poses, rows: NDArray[np.intp], new: Poses) -> Poses:
    positions, orientation = poses.positions.copy(), poses.rotations.copy()
    positions[rows], orientation[rows] = new.positions, new.rotations
    return Poses(positions, orientation)
