"""Poses that span the workspace, where a cell does not say what its robot is for."""

from __future__ import annotations

import numpy as np

from hexacell.experiment_design.candidates import reachable
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

TILT = np.radians(15.0)
"""Small enough for a machine that is not calibrated yet, large enough to show what tilting does."""


def workspace_poses(belief: RobotBelief, points: Array) -> PoseBatch:
    """At ball positions (m, 3), mm: level, tilted either way about x and y, turned either way about z.

    Left out is what the robot cannot reach within its limits, by its estimated geometry and by the
    controller's.
    """
    vectors = min(TILT, belief.limits.tilt) * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    turns = rotations.from_vector(vectors)
    positions = np.repeat(points, len(turns), axis=0)
    poses = PoseBatch(positions, np.tile(turns, (len(points), 1, 1)))
    return reachable(belief, poses).targets
