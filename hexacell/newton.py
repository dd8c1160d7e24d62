"""Newton's method on platform poses: many at once, of one robot or of another at each.

Forward kinematics has many solutions (assembly modes). What is found lies on the mode asked for, or
counts as not found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell import rotations
from hexacell.geometry import Geometries, Geometry
from hexacell.mechanisms.base import Mechanism
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

CONVERGED_MM = 1e-10
"""Constraints below this count as closed: legs are a metre, and doubles carry 16 digits."""

ON_THE_WAY_MM = 1e-3
"""Between two stages of a continuation: near enough to begin the next one."""

NEWTON_STEPS = 12
STAGE_STEPS = 6
"""In one stage of a continuation. What takes more is better served by shorter stages."""

LONGEST_STEP_MM = 60.0
LARGEST_TURN = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """Poses found by forward kinematics, and which of them can be trusted.

    Attributes:
        poses: n poses; where ``found`` is false, the last iterate.
        found: (n,) bool: converged to rounding, on the assembly mode it started from.
    """

    poses: Poses
    found: Mask


def assembly_mode(pose_jacobian: Array) -> Array:
    """The sign (n,) of the determinant of pose Jacobians (n, 6, 6): it changes at a singularity."""
    signs: Array = np.sign(np.linalg.det(pose_jacobian))
    return signs


def moved(poses: Poses, step: Array) -> Poses:
    """Poses after steps (n, 6): positions, mm, then rotation vectors in the base frame, rad."""
    return Poses(poses.positions + step[..., :3], rotations.from_vector(step[..., 3:]) @ poses.rotations)


def newton(
    mechanism: Mechanism,
    geometry: Geometry | Geometries,
    joints: Array,
    start: Poses,
    mode: Array,
    close_mm: float,
    steps: int = NEWTON_STEPS,
) -> Forward:
    """Newton's method on each pose, every step bounded; poses that close are left as they are."""
    search = _Search(mechanism, geometry, joints, start, mode)
    for _ in range(steps):
        # One that is out of reach has no number for an error, and is not open either.
        search.leave(~(search.errors() >= close_mm), close_mm)
        if not len(search.rows):
            break
        search.step()
    search.leave(np.ones(len(search.rows), dtype=bool), close_mm)
    return Forward(Poses(search.positions, search.rotations), search.found)


class _Search:
    """Poses that are sought, by their ``rows``, and those that the search has left."""

    def __init__(
        self,
        mechanism: Mechanism,
        geometry: Geometry | Geometries,
        joints: Array,
        start: Poses,
        mode: Array,
    ) -> None:
        self.positions, self.rotations = np.array(start.positions), np.array(start.rotations)
        self.found = np.zeros(len(joints), dtype=bool)
        self.rows = np.arange(len(joints))
        self._mechanism, self._geometry, self._mode = mechanism, geometry, mode
        self._joints, self._poses = joints, start
        self._error, self._jacobian = mechanism.closure(geometry, start, joints)

    def errors(self) -> Array:
        """How much the legs (n,) are too short or long at most, mm."""
        largest: Array = np.abs(self._error).max(axis=-1, initial=0.0)
        return largest

    def step(self) -> None:
        """All of them one step on."""
        self._poses = moved(self._poses, _step(self._jacobian, self._error))
        self._error, self._jacobian = self._mechanism.closure(self._geometry, self._poses, self._joints)

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
        if isinstance(self._geometry, Geometries):
            self._geometry = self._geometry[kept]


def _step(jacobian: Array, error: Array) -> Array:
    try:
        step = -np.linalg.solve(jacobian, error[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = -(np.linalg.pinv(jacobian) @ error[..., None])[..., 0]
    travel, turn = step[..., :3] / LONGEST_STEP_MM, step[..., 3:] / LARGEST_TURN
    too_long = np.sqrt(np.maximum(np.sum(travel * travel, axis=-1), np.sum(turn * turn, axis=-1)))
    shortened: Array = step / np.maximum(1.0, too_long)[..., None]
    return shortened
