"""Errors of poses in the frames that fit best: by scipy's general least squares, without the product's.

A base frame and the turn of the platform frame are taught; errors that another choice of them would
take away are none.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


def moved(poses: PoseBatch, frames: Array) -> PoseBatch:
    """Poses in other frames (9,): base turned, base shifted, mm, platform turned; rotation vectors."""
    base, platform = (Rotation.from_rotvec(part).as_matrix() for part in (frames[:3], frames[6:]))
    return PoseBatch(poses.positions @ base.T + frames[3:6], base @ poses.rotations @ platform)


def errors(reached: PoseBatch, wanted: PoseBatch) -> Array:
    """Position errors, mm, and rotation vectors, rad (n, 6)."""
    turned = reached.rotations @ np.swapaxes(wanted.rotations, -1, -2)
    return np.concatenate(
        [reached.positions - wanted.positions, Rotation.from_matrix(turned).as_rotvec()], axis=-1
    )


def best_frames(reached: PoseBatch, wanted: PoseBatch, length: float) -> Array:
    """The frames (9,) in which ``reached`` are nearest to ``wanted``; a rad counts as ``length``, mm."""
    weights = np.repeat([1.0, length], 3)

    def residuals(scaled: Array) -> Array:
        frames = scaled / np.repeat([length, 1.0, length], 3)
        found: Array = (errors(moved(reached, frames), wanted) * weights).ravel()
        return found

    found = least_squares(residuals, np.zeros(9), method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    best: Array = found.x / np.repeat([length, 1.0, length], 3)
    return best
