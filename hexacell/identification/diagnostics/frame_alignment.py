"""Frame alignment: pose errors after the base and platform frames are fitted (linear least squares).

The base frame and the rotation of the platform frame are conventions, set when a fixture or a tool is
taught. Pose errors are therefore compared after both frames are fitted. To first order a base
frame shifted by t and rotated by f, and a platform frame rotated by p about the ball, change a pose
(P, R) by

    dP = t + f x P,    dr = f + R p,

with dr the rotation vector in the base frame. The best (t, f, p) minimize the sum of squares over
poses that span the workspace, with rotations weighted by a length, the platform's radius. Not every
controller can turn a work frame about every axis: f is restricted to the axes about which it can be taught.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hexacell.kinematics import rotations
from hexacell.kinematics.mechanism import FrameTransform
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

MAX_ITERATIONS = 20
TOLERANCE = 1e-12
"""Convergence: largest rotation, rad, and largest shift divided by the length."""


def pose_errors(reached: PoseBatch, commanded: PoseBatch) -> Array:
    """Errors (n, 6): positions, mm, then rotation vectors in the base frame, rad."""
    relative = reached.rotations @ np.swapaxes(commanded.rotations, -1, -2)
    return np.concatenate([reached.positions - commanded.positions, rotations.to_vector(relative)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class FrameFit:
    """The best frames over n poses, rotations weighted by ``length``, mm.

    ``turns`` are the axes (k, 3) about which the base frame may be turned.
    """

    workspace: PoseBatch
    length: float
    turns: Array = field(default_factory=lambda: np.eye(3))

    def coefficients(self, errors: Array) -> Array:
        """The best (t, f, p) (9, ...), mm and rad, for errors (n, 6, ...)."""
        scale, free = np.repeat([1.0, self.length], 3), self._free
        design = (frame_derivatives(self.workspace) * scale[:, None]).reshape(-1, 9) @ free
        values = (errors.reshape(len(errors), 6, -1) * scale[:, None]).reshape(len(design), -1)
        # Equal poses do not determine the frames; lstsq then gives the smallest change.
        best: Array = free @ np.linalg.lstsq(design, values)[0]
        return best.reshape(9, *errors.shape[2:])

    @property
    def _free(self) -> Array:
        """From shifts, turns about the free axes and turns of the platform (6 + k) to (t, f, p) (9,)."""
        free = np.zeros((9, 6 + len(self.turns)))
        free[:3, :3] = free[6:, -3:] = np.eye(3)
        free[3:6, 3:-3] = self.turns.T
        return free

    def remove_frame_motion(self, poses: PoseBatch, errors: Array, workspace_errors: Array) -> Array:
        """Errors (k, 6, ...) of other poses minus what the best frames explain, to first order."""
        explained: Array = np.tensordot(
            frame_derivatives(poses), self.coefficients(workspace_errors), axes=1
        )
        return errors - explained

    def aligned(self, reached: PoseBatch, others: PoseBatch) -> PoseBatch:
        """Poses ``others`` in the frames that fit ``reached`` to the workspace best (Gauss-Newton)."""
        for _ in range(MAX_ITERATIONS):
            best = self.coefficients(pose_errors(reached, self.workspace))
            change = _inverse_change(best)
            reached, others = change.poses(reached), change.poses(others)
            if max(np.abs(best[:3]).max() / self.length, np.abs(best[3:]).max()) < TOLERANCE:
                break
        return others


def frame_derivatives(poses: PoseBatch) -> Array:
    """Derivatives (n, 6, 9) of pose errors by t, f and p."""
    design = np.zeros((len(poses), 6, 9))
    design[:, :3, :3] = np.eye(3)
    design[:, :3, 3:6] = -rotations.skew(poses.positions)
    design[:, 3:, 3:6] = np.eye(3)
    design[:, 3:, 6:] = poses.rotations
    return design


def _inverse_change(coefficients: Array) -> FrameTransform:
    """The change of frames that removes the errors with these coefficients (9,)."""
    shift, base, platform = coefficients.reshape(3, 3)
    return FrameTransform(rotations.from_vector(-base), shift, rotations.from_vector(platform))
