"""Forward kinematics: the pose that closes a geometry at given joint variables, batched.

Forward kinematics has many solutions (assembly modes). The one wanted is found by continuation:
start at a pose that belongs to a known geometry and known joint variables, and follow it by Newton's
method while both change into the ones asked for. What is found lies on the assembly mode asked for,
or counts as not found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

CONVERGED_MM = 1e-10
"""Constraints below this count as closed: legs are a metre, and doubles carry 16 digits."""

ON_THE_WAY_MM = 1e-3
"""Between two stages of a continuation: near enough to begin the next one."""

NEWTON_STEPS = 12
STAGE_STEPS = 6
"""In one stage of a continuation. What takes more is better served by shorter stages."""

LONGEST_STEP_MM = 60.0
LARGEST_TURN = 0.5

CONTINUATION_STAGES = (2, 8, 32)


@dataclass(frozen=True, slots=True, eq=False)
class ForwardResult:
    """Poses found by forward kinematics, and which of them can be trusted.

    Attributes:
        poses: n poses; where ``found`` is false, the last iterate.
        found: (n,) bool: converged to rounding, on the assembly mode it started from.
    """

    poses: PoseBatch
    found: Mask


def assembly_mode(pose_jacobian: Array) -> Array:
    """The sign (n,) of the determinant of pose Jacobians (n, 6, 6): it changes at a singularity."""
    signs: Array = np.sign(np.linalg.det(pose_jacobian))
    return signs


def apply_twist(poses: PoseBatch, step: Array) -> PoseBatch:
    """Poses after steps (n, 6): positions, mm, then rotation vectors in the base frame, rad."""
    return PoseBatch(
        poses.positions + step[..., :3], rotations.from_vector(step[..., 3:]) @ poses.rotations
    )


def newton(
    mechanism: Mechanism,
    geometry: Geometry | GeometryBatch,
    joints: Array,
    start: PoseBatch,
    mode: Array,
    close_mm: float,
    steps: int = NEWTON_STEPS,
) -> ForwardResult:
    """Newton's method on each pose, every step bounded; poses that close are left as they are."""
    search = _Search(mechanism, geometry, joints, start, mode)
    for _ in range(steps):
        # One that is out of reach has no number for an error, and is not open either.
        search.leave(~(search.errors() >= close_mm), close_mm)
        if not len(search.rows):
            break
        search.step()
    search.leave(np.ones(len(search.rows), dtype=bool), close_mm)
    return ForwardResult(PoseBatch(search.positions, search.rotations), search.found)


class _Search:
    """Poses that are sought, by their ``rows``, and those that the search has left."""

    def __init__(
        self,
        mechanism: Mechanism,
        geometry: Geometry | GeometryBatch,
        joints: Array,
        start: PoseBatch,
        mode: Array,
    ) -> None:
        self.positions, self.rotations = np.array(start.positions), np.array(start.rotations)
        self.found = np.zeros(len(joints), dtype=bool)
        self.rows = np.arange(len(joints))
        self._mechanism, self._geometry, self._mode = mechanism, geometry, mode
        self._joints, self._poses = joints, start
        self._error, self._jacobian = mechanism.residual_and_jacobian(geometry, start, joints)

    def errors(self) -> Array:
        """How much the legs (n,) are too short or long at most, mm."""
        largest: Array = np.abs(self._error).max(axis=-1, initial=0.0)
        return largest

    def step(self) -> None:
        """All of them one step on."""
        self._poses = apply_twist(self._poses, _step(self._jacobian, self._error))
        self._error, self._jacobian = self._mechanism.residual_and_jacobian(
            self._geometry, self._poses, self._joints
        )

    def leave(self, ended: Mask, close_mm: float) -> None:
        """Leave some where they are now."""
        if not ended.any():
            return
        at, closed = self.rows[ended], self.errors()[ended] < close_mm
        self.positions[at] = self._poses.positions[ended]
        self.rotations[at] = self._poses.rotations[ended]
        self.found[at[closed]] = assembly_mode(self._jacobian[ended][closed]) == self._mode[at[closed]]
        self._keep(np.flatnonzero(~ended))

    def _keep(self, kept: NDArray[np.intp]) -> None:
        self.rows, self._poses, self._joints = self.rows[kept], self._poses[kept], self._joints[kept]
        self._error, self._jacobian = self._error[kept], self._jacobian[kept]
        if isinstance(self._geometry, GeometryBatch):
            self._geometry = self._geometry.subset(kept)


def _step(jacobian: Array, error: Array) -> Array:
    try:
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = -(np.linalg.pinv(jacobian) @ error[..., None])[..., 0]
    travel, turn = step[..., :3] / LONGEST_STEP_MM, step[..., 3:] / LARGEST_TURN
    too_long = np.sqrt(np.maximum(np.sum(travel * travel, axis=-1), np.sum(turn * turn, axis=-1)))
    shortened: Array = step / np.maximum(1.0, too_long)[..., None]
    return shortened


def forward_kinematics(
    mechanism: Mechanism,
    geometry: Geometry | GeometryBatch,
    joints: Array,
    start: PoseBatch,
    *,
    mode: Array | None = None,
    close_mm: float = CONVERGED_MM,
) -> ForwardResult:
    """Poses of n joint vectors (n, 6), mm, by damped Newton steps from nearby poses.

    ``geometry`` is one for all of them, or one for each. ``mode`` (n,) is the sign of the Jacobian's
    determinant to be kept; by default that at ``start``. Legs may be ``close_mm`` too short or long.
    """
    if mode is None:
        mode = assembly_mode(mechanism.residual_and_jacobian(geometry, start, joints)[1])
    return newton(mechanism, geometry, joints, start, mode, close_mm)


def continue_solution(
    mechanism: Mechanism,
    geometry: Geometry,
    joints: Array,
    *,
    start: PoseBatch,
    start_geometry: Geometry,
    start_joints: Array,
    tries: Sequence[int] = CONTINUATION_STAGES,
) -> ForwardResult:
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
        poses = poses.with_rows(rows, result.poses)
        found[rows] = result.found
    return ForwardResult(poses, found)


def _staged(
    mechanism: Mechanism,
    geometries: tuple[Geometry, Geometry],
    joints: tuple[Array, Array],
    start: PoseBatch,
    stages: int,
) -> ForwardResult:
    poses = start
    rows = np.arange(len(start))
    mode = assembly_mode(mechanism.residual_and_jacobian(geometries[0], start, joints[0])[1])
    for stage in range(1, stages + 1):
        fraction = stage / stages
        geometry = geometries[0].interpolate(geometries[1], fraction)
        now = (1.0 - fraction) * joints[0][rows] + fraction * joints[1][rows]
        close_mm = CONVERGED_MM if stage == stages else ON_THE_WAY_MM
        result = newton(mechanism, geometry, now, poses[rows], mode[rows], close_mm, STAGE_STEPS)
        poses = poses.with_rows(rows, result.poses)
        # Those that failed are not led on: they would cost more than all the others.
        rows = rows[result.found]
    found = np.zeros(len(start), dtype=bool)
    found[rows] = True
    return ForwardResult(poses, found)
