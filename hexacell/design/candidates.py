"""Candidate poses, poses that span the workspace, and the commands that bring the robot to them."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import has_singularity_margin, margin_and_mode

TWIST_PER_TILT = 2.0
"""Largest twist (rotation about the platform's normal) as a multiple of the largest tilt. Only the legs
limit twists, and they are as informative as tilts."""

SMALLEST_SHARE = 0.004
"""Share of the largest amplitude. Under the drawing's tolerances some robots allow no more."""

WORKSPACE_ANGLE = np.radians(15.0)
"""Small enough for a robot that is not calibrated yet, large enough to show errors of orientation."""


class Amplitudes(Enum):
    """How the amplitudes of candidate rotations are distributed.

    The value is the share that is distributed evenly over all orders of magnitude; the rest are large.
    """

    ALL_SCALES = 0.5
    MOSTLY_LARGE = 0.0625


@dataclass(frozen=True, slots=True, eq=False)
class ReachableTargets(Batch):
    """Poses (n) that the estimated robot takes within its limits, and its joint variables (n, 6) there."""

    poses: PoseBatch
    joints: Array


@lru_cache(maxsize=64)
def orientations(
    count: int,
    tilt: float,
    seed: int,
    amplitudes: Amplitudes = Amplitudes.ALL_SCALES,
    most_twist: float = np.pi,
) -> Array:
    """``count`` rotations (count, 3, 3): tilts up to ``tilt``, rad, after twists up to twice as large.

    No twist is larger than ``most_twist``, rad. They are quasi-random, from a scrambled Sobol' sequence;
    ``count`` is a power of two.
    """
    from scipy.stats import qmc  # noqa: PLC0415 - half a second that only this function needs

    heading, tilted, sign, twisted, scale = qmc.Sobol(5, seed=seed).random(count).T
    angle = tilt * _amplitudes(tilted, scale, amplitudes)
    direction = np.where(sign < 0.5, -1.0, 1.0)
    largest_twist = min(TWIST_PER_TILT * tilt, most_twist)
    twist = largest_twist * _amplitudes(twisted, scale, amplitudes) * direction
    heading, zero = 2.0 * np.pi * heading, np.zeros(count)
    tilts = angle[:, None] * np.stack([np.cos(heading), np.sin(heading), zero], axis=-1)
    twists = np.stack([zero, zero, twist], axis=-1)
    turned: Array = rotations.from_vector(tilts) @ rotations.from_vector(twists)
    turned.setflags(write=False)  # it is given to all who ask for the same
    return turned


def _amplitudes(uniform: Array, scale: Array, amplitudes: Amplitudes) -> Array:
    """Shares of the largest amplitude, from values distributed uniformly over 0 to 1."""
    large = np.sqrt(uniform) if amplitudes is Amplitudes.MOSTLY_LARGE else uniform
    return np.where(scale < amplitudes.value, SMALLEST_SHARE ** (1.0 - uniform), large)


def rows_apart(rotations: Array, ranking: NDArray[np.intp], most: int, apart: float) -> NDArray[np.intp]:
    """The first of some ranked orientations (n, 3, 3), none of them within ``apart``, rad, of another."""
    flat = rotations[ranking].reshape(-1, 9)
    is_near = flat @ flat.T >= 1.0 + 2.0 * np.cos(apart)
    is_left_out = np.zeros(len(flat), dtype=bool)
    kept: list[int] = []
    for row in range(len(flat)):
        if not is_left_out[row]:
            kept.append(row)
            if len(kept) == most:
                break
            is_left_out |= is_near[row]
    return ranking[kept]


def targets_within_limits(belief: RobotBelief, poses: PoseBatch) -> ReachableTargets:
    """The poses that the estimated robot takes within its limits, next to a singularity too.

    Of a robot that lacks some freedoms those that it has instead, at the same places.
    """
    poses = belief.mechanism.completed(belief.estimate, poses)
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
    rows = np.flatnonzero(belief.keeps_limits(poses, joints))
    return ReachableTargets(poses[rows], joints[rows])


def reachable_targets(belief: RobotBelief, poses: PoseBatch, mode: Array | None = None) -> ReachableTargets:
    """The poses that the estimated robot takes within its limits, clear of singularities.

    With an assembly ``mode`` (1,), only poses on that mode: no path leads to another one.
    """
    targets = targets_within_limits(belief, poses)
    margin = belief.limits.singularity_margin
    clear, modes = margin_and_mode(belief.mechanism, belief.estimate, targets.poses, targets.joints, margin)
    if mode is not None:
        clear &= modes == mode
    return targets if clear.all() else targets[clear]


def commands_for(belief: RobotBelief, targets: ReachableTargets) -> tuple[PoseBatch, Mask]:
    """The commands (n) that bring the estimated robot to n targets, and which of them do (n,).

    None does where the controller's own geometry cannot take the joint variables, or only next to a
    singularity, on another assembly mode or beyond the limits of a command.
    """
    commands = belief.commanded.commands_for(targets.poses, targets.joints)
    at = belief.mechanism, belief.controller, commands.poses, targets.joints
    clear = has_singularity_margin(*at, belief.limits.singularity_margin)
    return commands.poses, commands.found & clear & belief.limits.allow_commands(commands.poses)


def outcomes_of(belief: RobotBelief, commands: PoseBatch) -> tuple[ReachableTargets, NDArray[np.intp]]:
    """Where commands bring the estimated robot, and the rows of those that do so within its limits."""
    actual = belief.commanded.actual_poses(commands)
    found = actual.found & belief.limits.allow_commands(commands)
    found[found] = belief.keeps_limits(actual.poses[found], actual.joints[found])
    rows = np.flatnonzero(found)
    targets = ReachableTargets(actual.poses[rows], actual.joints[rows])
    margin = belief.limits.singularity_margin
    clear = has_singularity_margin(belief.mechanism, belief.estimate, targets.poses, targets.joints, margin)
    return targets[clear], rows[clear]


def reachable(belief: RobotBelief, poses: PoseBatch) -> tuple[ReachableTargets, PoseBatch]:
    """The poses that the estimated robot can be commanded to within its limits, and how."""
    targets = reachable_targets(belief, poses)
    commands, found = commands_for(belief, targets)
    return targets[found], commands[found]


def workspace_poses(belief: RobotBelief, points: Array) -> PoseBatch:
    """Seven poses at each ball position (m, 3), mm: level, and rotated in both directions about x, y and z.

    Poses that the robot cannot take within its limits, by its estimated geometry or by the controller's,
    are left out.
    """
    axes = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    rotated = rotations.from_vector(min(WORKSPACE_ANGLE, belief.limits.tilt) * axes)
    poses = PoseBatch(np.repeat(points, len(rotated), axis=0), np.tile(rotated, (len(points), 1, 1)))
    return reachable(belief, poses)[0].poses
