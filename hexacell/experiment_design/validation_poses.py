"""Poses that judge the result: commanded as a user would, inside the travel, away from all others.

Away from each other, and from the orientations that the geometry was identified with: near those it
fits in any case.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.candidates import within_limits
from hexacell.experiment_design.predicted_records import TRAVEL_SHARE
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity, singularity_margin
from hexacell.motion.path_check import is_clear

SAFETY_SIGMAS = 3.0
"""They are few and not chosen for where they lie, so that hardly one comes near this limit; what has
tilts too small would judge too kindly."""


def select_validation_poses(
    belief: RobotBelief, point: Array, count: int, orientations: Array, used: Array | None = None
) -> PoseBatch:
    """``count`` poses at a point (3,), mm, the first of them untilted.

    The controller is sent there with its own geometry, uncorrected; the ball must surely stay
    within the travel all the same, and the corrected robot must be able to go there too. Of the
    orientations (n, 3, 3) that do, those are taken in which the platform really stands farthest from
    where it stands in the others and in the ``used`` ones (k, 3, 3), wherever these were.

    Raises:
        LimitError: too few of them do.
    """
    poses = PoseBatch.at(point, np.concatenate([np.eye(3)[None], orientations]))
    joints = belief.mechanism.inverse(belief.controller, belief.branch, poses)
    usable = np.flatnonzero(within_limits(belief.limits, poses, joints) & _after(belief, poses))
    if not len(usable) or usable[0] != 0:
        raise LimitError(f"the untilted platform cannot stand at {poses.pose(0)} within the limits")
    really, inside = _inside_travel(belief, poses[usable], joints[usable])
    if not inside[0]:
        raise LimitError(f"where the robot really goes for {poses.pose(0)} cannot be told")
    kept = poses[usable[inside]]
    stands = really.rotations[inside]
    taken = _farthest_apart(belief, kept, stands, _nearest(stands, used), count)
    if len(taken) < count:
        raise LimitError(
            f"only {len(taken)} orientations at {poses.pose(0)} keep the ball inside the travel"
        )
    return kept[taken]


def _after(belief: RobotBelief, poses: PoseBatch) -> Mask:
    """Which poses the estimated geometry can take within the limits."""
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
    fits = within_limits(belief.limits, poses, joints)
    rows = np.flatnonzero(fits)
    margin = singularity_margin(belief.mechanism, belief.estimate, poses[rows], joints[rows])
    fits[rows] &= margin >= belief.limits.singularity_margin
    return fits


def _inside_travel(belief: RobotBelief, poses: PoseBatch, joints: Array) -> tuple[PoseBatch, Mask]:
    """Where the uncorrected robot goes; is it surely inside the travel of gauges zeroed at the first."""
    really = continue_solution(
        belief.mechanism,
        belief.estimate,
        joints,
        start=poses,
        start_geometry=belief.controller,
        start_joints=joints,
    )
    sensitivity = pose_sensitivity(belief.mechanism, belief.estimate, really.poses, joints)
    jacobian = sensitivity.parameters[:, :3] @ belief.basis
    change = jacobian - jacobian[0]
    spread = change @ belief.covariance @ np.swapaxes(change, -1, -2)
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1) + 2.0 * belief.noise.gauge_mm**2)
    deviation = really.poses.positions - really.poses.positions[0]
    limit = TRAVEL_SHARE * belief.limits.gauge_travel_mm
    inside: Mask = (np.abs(deviation) + SAFETY_SIGMAS * sigma <= limit).all(axis=-1)
    inside &= really.found
    inside[0] = really.found[0]
    return really.poses, inside


def _nearest(stands: Array, used: Array | None) -> Array:
    """How far orientations (n, 3, 3) are from the nearest of those used (n,), rad."""
    apart = np.full(len(stands), np.inf)
    for other in () if used is None else used:
        apart = np.minimum(apart, _angles(stands, other))
    return apart


def _angles(stands: Array, other: Array) -> Array:
    angles: Array = np.linalg.norm(rotations.to_vector(stands @ other.T), axis=-1)
    return angles


def _farthest_apart(
    belief: RobotBelief, poses: PoseBatch, stands: Array, apart: Array, count: int
) -> list[int]:
    """Rows of poses from the first on, each next one farthest from those taken, a clear way ahead.

    ``stands`` (n, 3, 3) is how the platform really stands in them, ``apart`` (n,), rad, how far that
    is from what was taken before. A way must be clear there and back to the first, where the set ends,
    with the ball inside the travel.
    """
    taken = [0]
    while len(taken) < count:
        apart = np.minimum(apart, _angles(stands, stands[taken[-1]]))
        best = int(np.argmax(apart))
        while apart[best] > 0.0 and not _ways_clear(belief, poses, (taken[-1], best, 0)):
            apart[best] = 0.0
            best = int(np.argmax(apart))
        if apart[best] <= 0.0:
            break
        taken.append(best)
    return taken


def _ways_clear(belief: RobotBelief, poses: PoseBatch, rows: tuple[int, ...]) -> bool:
    reference = _zeroed(belief, poses[[0]])
    return all(is_clear(belief, poses[[start]], poses[[end]], reference) for start, end in pairwise(rows))


def _zeroed(belief: RobotBelief, first: PoseBatch) -> Array:
    """Where the uncorrected robot really takes the ball (3,), mm, for the pose that zeroes the gauges."""
    joints = belief.mechanism.inverse(belief.controller, belief.branch, first)
    really = continue_solution(
        belief.mechanism,
        belief.estimate,
        joints,
        start=first,
        start_geometry=belief.controller,
        start_joints=joints,
    )
    ball: Array = really.poses.positions[0]
    return ball
