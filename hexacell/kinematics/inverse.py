"""Inverse kinematics: the joint variables of a pose, in closed form, leg by leg."""

from __future__ import annotations

import numpy as np

from hexacell.errors import ReachError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


def inverse_kinematics(mechanism: Mechanism, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
    """Joint variables (n, 6), mm, of n poses.

    Raises:
        ReachError: a pose is out of a leg's reach; the message names both.
    """
    joints = mechanism.inverse(geometry, branch, poses)
    if np.isnan(joints).any():
        row, leg = np.argwhere(np.isnan(joints))[0]
        raise ReachError(f"leg {leg + 1} cannot reach the pose {poses.pose(row)}")
    return joints
