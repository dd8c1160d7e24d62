"""Held-out poses that validate the result: commanded as a user would, inside the travel, far apart.

They are far from each other and from the orientations that the geometry was identified with, near which
it fits in any case: a greedy maximin (space-filling) design (Johnson, Moore & Ylvisaker, J. Stat. Planning
and Inference 26, 1990).
"""

from dataclasses import replace

import numpy as np

from hexacell.design.candidates import ReachableTargets, reachable_targets
from hexacell.design.criteria import innovation_covariance
from hexacell.design.predicted_records import CHANCE_SIGMAS, TRAVEL_SHARE, position_derivatives
from hexacell.design.short_order import short_order
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.commanded_motion import ActualPoses
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.motion.path_check import is_clear

SAFETY_SIGMAS = 3.0
"""Fewer than for identification: these poses are few and not chosen near the limit of the travel, and
smaller tilts would validate too little."""


def select_validation_poses(
    belief: RobotBelief,
    point: Array,
    count: int,
    turns: Array,
    used: Array | None = None,
    coming_from: PoseBatch | None = None,
) -> PoseBatch:
    """``count`` poses at a point (3,), mm; the first is level, the others in a short order from there.

    Or from a command (1) that the robot is ``coming_from``, at the same point, and in any case back to the
    first.

    The ball stays inside the travel although the controller still commands with its own geometry, and
    the corrected robot can take them too. Of the ``turns`` (n, 3, 3) that allow this, those are
    selected whose actual orientations are farthest from each other and from the ``used`` ones (k, 3, 3),
    wherever these were measured.

    Raises:
        LimitError: too few of them do.
    """
    drawn = PoseBatch.at(point, belief.limits.orientations(np.concatenate([np.eye(3)[None], turns])))
    every = belief.mechanism.completed(belief.estimate, drawn)
    limits = belief.limits
    allowed = limits.allow_commands(every) & limits.allow_joints(belief.commanded.joints(every))
    poses = reachable_targets(belief, every[allowed]).poses
    if not len(poses) or not np.array_equal(poses.rotations[0], every.rotations[0]):
        raise LimitError(f"the untilted platform cannot reach {every.pose(0)} within the limits")
    actual = belief.commanded.actual_poses(poses)
    if not actual.found[0]:
        raise LimitError(f"the actual pose at the command {poses.pose(0)} cannot be computed")
    inside = _stays_inside(belief, actual)
    if not inside[0]:
        raise LimitError(f"the actual pose at the command {poses.pose(0)} is not within the limits")
    # The ball stays inside the travel on the way, too, wherever the gauges will be zeroed.
    belief = replace(belief, limits=limits.surely_zeroed())
    selected = _select_farthest(belief, poses[inside], actual.poses[inside], used, count)
    if len(selected) < count:
        raise LimitError(
            f"only {len(selected)} orientations at {poses.pose(0)} keep the ball inside the travel"
        )
    chosen, there = poses[inside][selected], actual.poses[inside][selected]
    return chosen[_in_short_order(belief, chosen, there.positions[0], coming_from)]


def _stays_inside(belief: RobotBelief, actual: ActualPoses) -> Mask:
    """At which poses the ball stays inside the travel of gauges that are zeroed at the first of them.

    Only those at which the robot keeps its limits too.
    """
    jacobian, by_joints = position_derivatives(belief, ReachableTargets(actual.poses, actual.joints))
    as_known = innovation_covariance(belief.joint_covariance, jacobian - jacobian[0], np.zeros((3, 3)))
    sigma = belief.limits.sigma_along_gauges(as_known)
    each = belief.noise.chance_covariance(by_joints)
    chance = belief.limits.sigma_along_gauges(each + each[0])
    deviation, spread = actual.poses.positions - actual.poses.positions[0], SAFETY_SIGMAS * sigma
    stopped = np.hypot(spread, CHANCE_SIGMAS * chance)
    # They are chosen long before the gauges are placed there.
    inside = belief.limits.surely_zeroed().within_travel(deviation, spread, TRAVEL_SHARE)
    inside &= belief.limits.within_travel(deviation, stopped, TRAVEL_SHARE)
    inside[0] = True
    inside &= actual.found
    inside[inside] = belief.keeps_limits(actual.poses[inside], actual.joints[inside])
    return inside


def _select_farthest(
    belief: RobotBelief, commands: PoseBatch, actual: PoseBatch, used: Array | None, count: int
) -> list[int]:
    """Rows of commands: the first, then each next one farthest from those selected and used.

    The straight lines from each to the next, and back to the first, must be clear.
    """
    distance = np.full(len(commands), np.inf)
    for orientation in () if used is None else used:
        distance = np.minimum(distance, _angles(actual.rotations, orientation))
    reference, selected = actual.positions[0], [0]
    while len(selected) < count:
        last = selected[-1]
        distance = np.minimum(distance, _angles(actual.rotations, actual.rotations[last]))
        best = int(np.argmax(distance))
        while distance[best] > 0.0 and not (
            is_clear(belief, commands[[last]], commands[[best]], reference)
            and is_clear(belief, commands[[best]], commands[[0]], reference)
        ):
            distance[best] = 0.0
            best = int(np.argmax(distance))
        if distance[best] <= 0.0:
            break
        selected.append(best)
    return selected


def _in_short_order(
    belief: RobotBelief, commands: PoseBatch, reference: Array, coming_from: PoseBatch | None
) -> list[int]:
    """Rows of selected commands: the first, then the others as the way over them and back is short."""
    home = commands[[0]]
    way = PoseBatch.joined([coming_from or home, commands[np.arange(1, len(commands))], home])
    apart = np.array([_angles(way.rotations, turned) for turned in way.rotations])

    def is_clear_between(start: int, end: int) -> bool:
        # The way from another list of poses is planned when it is gone.
        is_begin = start == 0 and coming_from is not None
        return is_begin or is_clear(belief, way[[start]], way[[end]], reference)

    order = short_order(apart, is_clear_between)
    return [0, *(range(1, len(commands)) if order is None else order)]


def _angles(orientations: Array, other: Array) -> Array:
    """Angles (n,), rad, between orientations (n, 3, 3) and another one (3, 3)."""
    return np.asarray(np.linalg.norm(rotations.to_vector(orientations @ other.T), axis=-1))
