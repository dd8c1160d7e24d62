"""Whether a robot can stand at commands: its limits, and its distance from singularities."""

from __future__ import annotations

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.commanded_motion import ActualPoses
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Mask
from hexacell.kinematics.sensitivity import has_singularity_margin
from hexacell.motion.path_check import MARGIN_SHARE


def stands_clear(belief: RobotBelief, commands: PoseBatch, actual: ActualPoses) -> Mask:
    """At which of n commands a robot that stands there, ``actual``, is clear of singularities.

    It is what :func:`~hexacell.motion.path_check.is_clear` says of the line from a command to itself: other
    limits it may be beyond.
    """
    found = np.flatnonzero(actual.found)
    geometries = (belief.controller, commands[found]), (belief.estimate, actual.poses[found])
    least = MARGIN_SHARE * belief.limits.singularity_margin
    clear, joints = np.array(actual.found), actual.joints[found]
    for geometry, poses in geometries:
        clear[found] &= has_singularity_margin(belief.mechanism, geometry, poses, joints, least)
    return clear


def stands_within_limits(belief: RobotBelief, commands: PoseBatch, *, certainly: bool) -> Mask:
    """At which of n commands the estimated robot keeps its limits and is clear of singularities.

    ``certainly``: so that it also keeps those of passive joints and legs for what is not known of it.
    """
    actual = belief.commanded.actual_poses(commands)
    found = np.flatnonzero(actual.found)
    at = actual[found]
    margins = belief.limits.leg_margins(belief.mechanism, belief.estimate, at.poses, at.joints)
    wanted = belief.margins_at(at) if certainly else belief.least_margins
    kept = belief.limits.allow_poses(at.poses, at.joints) & (margins >= wanted).all(axis=-1)
    stands = np.array(actual.found)
    stands[found] = kept
    return stands & stands_clear(belief, commands, actual)
