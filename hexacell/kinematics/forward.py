"""Forward kinematics: damped Newton's method and numerical continuation, batched.

The pose x of a mechanism with the geometry G at the joint variables q solves the six constraints
``c(x; G, q) = 0``. Newton's method updates the pose by a twist d (translation, rotation vector) with

    J d = -c,    J = dc/dd,

and shortens d to a largest translation and rotation, because the linearisation does not hold beyond.

A parallel mechanism has up to 40 solutions (assembly modes), and Newton's method may converge to any of
them. The wanted solution is found by continuation (homotopy): from a pose x0 that solves (G0, q0), the
geometry and the joint variables change linearly to (G, q) in a few stages, and each stage starts from
the solution of the one before. The sign of det J changes only at a singularity. A solution on which
the sign differs from that at x0 is on another assembly mode and counts as not found.

One stage is enough where Newton's method contracts from x0 at once: each step is at most a quarter of the
one before.

Sources: Merlet, Parallel Robots, 2nd ed. 2006 (Newton's method and assembly modes);
Allgower and Georg, Numerical Continuation Methods, 1990;
Deuflhard, Newton Methods for Nonlinear Problems, 2004, sec. 5.1 (contraction along a homotopy).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometries, Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

TOLERANCE_MM = 1e-10
"""Largest constraint of a solution: legs are about 1 m long, and doubles have 16 digits."""

STAGE_TOLERANCE_MM = 1e-3
"""Largest constraint at the end of an intermediate stage: the next stage corrects the rest."""

MAX_STEPS = 12
MAX_STAGE_STEPS = 6
"""Newton steps in one stage of a continuation. Shorter stages cost less than more steps."""

MAX_TRANSLATION_MM = 60.0
MAX_ROTATION_RAD = 0.5

STEP_SHARES = 1.0 / np.repeat([MAX_TRANSLATION_MM, MAX_ROTATION_RAD], 3)

CONTINUATION_STAGES = (2, 8, 32)
"""Numbers of stages, tried in this order."""

LARGEST_CONTRACTION = 0.25
"""Largest ratio of two Newton steps where one stage is enough."""


@dataclass(frozen=True, slots=True, eq=False)
class ForwardResult:
    """Poses by forward kinematics, the last iterates where they are not found.

    ``found`` (n,): converged, on the required assembly mode.
    """

    poses: PoseBatch
    found: Mask


def assembly_mode(pose_jacobian: Array) -> Array:
    """Sign (n,) of the determinant of pose Jacobians (n, 6, 6); it changes only at a singularity."""
    return np.asarray(np.sign(np.linalg.det(pose_jacobian)))


def modes_of(mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array) -> Array:
    """:func:`assembly_mode` (n,) of n poses at joint variables (n, J); one geometry, or one for each."""
    return assembly_mode(mechanism.residual_and_jacobian(geometry, poses, joints)[1])


def apply_twist(poses: PoseBatch, step: Array) -> PoseBatch:
    """Poses (n) displaced by twists (n, 6): translations, mm, then rotation vectors in the base, rad."""
    return PoseBatch(
        poses.positions + step[..., :3], rotations.from_vector(step[..., 3:]) @ poses.rotations
    )


def _damped_step(jacobian: Array, error: Array) -> tuple[Array, Array]:
    """Newton steps (n, 6), shortened to the largest translation and rotation.

    And what they were (n,) as a share of the largest ones.
    """
    try:
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = -(np.linalg.pinv(jacobian) @ error[..., None])[..., 0]
    # Both of them in rows: sums over parts of an array take several times as long.
    shares = (step * STEP_SHARES).reshape(-1, 2, 3)
    sizes: Array = np.sqrt(np.einsum("nij,nij->ni", shares, shares).max(axis=-1))
    if (too_large := sizes > 1.0).any():
        step[too_large] /= sizes[too_large, None]
    return step, sizes


def forward_kinematics(
    mechanism: Mechanism,
    geometry: Geometries,
    joints: Array,
    start: PoseBatch,
    *,
    mode: Array | None = None,
    tolerance_mm: float = TOLERANCE_MM,
    max_steps: int = MAX_STEPS,
    largest_contraction: float = np.inf,
) -> ForwardResult:
    """Poses of n joint vectors by damped Newton's method; a pose that has converged is not changed further.

    ``joints`` (n, J) are in their unit, and ``start`` are n nearby poses, whose assembly ``mode`` (n,) is
    required by default. No constraint of a solution is larger than ``tolerance_mm``. Poses of which a step
    is more than the ``largest_contraction`` of the one before are not found; with less than 1, nor those
    whose first step is too large.
    """
    positions, orientations = np.array(start.positions), np.array(start.rotations)
    found = np.zeros(len(joints), dtype=bool)
    # What follows is of the active poses; the others have their final values.
    rows, poses = np.arange(len(joints)), start
    error, jacobian = mechanism.residual_and_jacobian(geometry, poses, joints)
    required = assembly_mode(jacobian) if mode is None else mode
    contracts = np.ones(len(joints), dtype=bool)
    is_limited = largest_contraction < np.inf
    # What has to contract at once begins with a step that is not shortened.
    most = np.full(len(joints), 1.0 if largest_contraction < 1.0 else np.inf)
    for number in range(max_steps + 1):
        errors = np.abs(error).max(axis=-1, initial=0.0)
        # A pose with the error NaN, which no step can improve, does not go on either.
        goes_on = (errors >= tolerance_mm) & contracts & (number < max_steps)
        left = goes_on.nonzero()[0]
        if len(left) < len(rows):
            converged = (errors < tolerance_mm) & contracts
            final = rows[~goes_on]
            positions[final], orientations[final] = poses.positions[~goes_on], poses.rotations[~goes_on]
            final = rows[converged]
            found[final] = assembly_mode(jacobian[converged]) == required[final]
            rows, poses, joints, most = rows[left], poses[left], joints[left], most[left]
            error, jacobian, geometry = error[left], jacobian[left], _of_rows(geometry, left)
        if not len(left):
            break
        step, sizes = _damped_step(jacobian, error)
        contracts = sizes <= most
        if is_limited:
            most = largest_contraction * sizes
        poses = apply_twist(poses, step)
        error, jacobian = mechanism.residual_and_jacobian(geometry, poses, joints)
    return ForwardResult(PoseBatch(positions, orientations), found)


def continue_solution(
    mechanism: Mechanism,
    geometry: Geometries,
    joints: Array,
    *,
    start: PoseBatch,
    start_geometry: Geometry,
    start_joints: Array | None = None,
    stage_counts: Sequence[int] = CONTINUATION_STAGES,
) -> ForwardResult:
    """Poses of n joint vectors (n, J), in their unit, by continuation from n known poses.

    Those close ``start_geometry`` at ``start_joints`` (n, J): by default ``joints``, so that only the
    geometry changes. The next of the ``stage_counts`` is tried for the poses where one fails.
    """
    if start_joints is None:
        start_joints = joints
    at_once = forward_kinematics(
        mechanism,
        geometry,
        joints,
        start,
        mode=modes_of(mechanism, start_geometry, start, start_joints),
        max_steps=MAX_STAGE_STEPS,
        largest_contraction=LARGEST_CONTRACTION,
    )
    found = at_once.found.copy()
    poses = start.with_rows(found, at_once.poses[found])
    for stages in stage_counts:
        rows = np.flatnonzero(~found)
        if not len(rows):
            break
        both_joints = (start_joints[rows], joints[rows])
        ends = (start_geometry, _of_rows(geometry, rows))
        result = _continue_in_stages(mechanism, ends, both_joints, start[rows], stages)
        poses = poses.with_rows(rows, result.poses)
        found[rows] = result.found
    return ForwardResult(poses, found)


def _continue_in_stages(
    mechanism: Mechanism,
    geometries: tuple[Geometry, Geometries],
    joints: tuple[Array, Array],
    start: PoseBatch,
    stages: int,
) -> ForwardResult:
    """Continuation from the first to the second of two geometries and joint vectors (n, J), mm."""
    poses = start
    rows = np.arange(len(start))
    mode = modes_of(mechanism, geometries[0], start, joints[0])
    for stage in range(1, stages + 1):
        fraction = stage / stages
        geometry = _of_rows(geometries[1], rows).interpolate_from(geometries[0], fraction)
        stage_joints = (1.0 - fraction) * joints[0][rows] + fraction * joints[1][rows]
        tolerance_mm = TOLERANCE_MM if stage == stages else STAGE_TOLERANCE_MM
        result = forward_kinematics(
            mechanism,
            geometry,
            stage_joints,
            poses[rows],
            mode=mode[rows],
            tolerance_mm=tolerance_mm,
            max_steps=MAX_STAGE_STEPS,
        )
        poses = poses.with_rows(rows, result.poses)
        # A failed pose takes the most steps, and the next stages could not find it either.
        rows = rows[result.found]
    found = np.zeros(len(start), dtype=bool)
    found[rows] = True
    return ForwardResult(poses, found)


def _of_rows(geometry: Geometries, rows: NDArray[np.intp]) -> Geometries:
    """The geometry of some poses."""
    return geometry.subset(rows) if isinstance(geometry, GeometryBatch) else geometry
