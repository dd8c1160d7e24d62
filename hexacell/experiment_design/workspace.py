"""Poses that span the workspace, for cells that state no task poses."""

from __future__ import annotations

import numpy as np

from hexacell.experiment_design.candidates import reachable
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

ANGLE = np.radians(15.0)
"""Small enough for a robot that is not calibrated yet, large enough to show errors of orientation."""


def workspace_poses(belief: RobotBelief, points: Array) -> PoseBatch:
    """Seven poses at each ball position (m, 3), mm: level, and rotated both ways about x, y and z.

    Poses that the robot cannot take within its limits, by its estimated geometry or by the controller's,
    are left out.
    """
    vectors = min(ANGLE, belief.limits.tilt) * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    rotated = rotations.from_vector(vectors)
    positions = np.repeat(points, len(rotated), axis=0)
    poses = PoseBatch(positions, np.tile(rotated, (len(points), 1, 1)))
    return reachable(belief, poses).targets.poses
