"""Poses to choose from, and the commands that would bring the robot there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import Limits, RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import has_singularity_margin, margin_and_mode

TWISTS_A_TILT = 2.0
"""Turns about the platform's own normal go so many times as far as tilts: nothing limits them but
the legs, and they tell as much."""

COMMAND_TRIES = (3,)
"""Stages of the continuation to a command. What takes more is next to a singularity, and left out."""

MANY_SMALL = 0.5
FEW_SMALL = 0.0625
"""Of the turns, spread over all scales."""

SMALLEST_SHARE = 0.004
"""Of the largest amplitude. With the drawing's tolerances alone some robots bear no more."""


@dataclass(frozen=True, slots=True, eq=False)
class ReachableTargets:
    """Poses that the estimated robot can take within its limits.

    Attributes:
        targets: n poses under the estimate.
        joints: joint variables (n, 6), mm, that take the estimated robot there.
    """

    targets: PoseBatch
    joints: Array

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> ReachableTargets:
        return ReachableTargets(self.targets[rows], self.joints[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Poses that the robot can be brought to.

    Attributes:
        targets: poses aimed at, under the estimate.
        joints: joint variables (n, 6), mm, that take the estimated robot there.
        commands: poses that make the controller, with its own geometry, go to those joints.
    """

    targets: PoseBatch
    joints: Array
    commands: PoseBatch

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> Candidates:
        return Candidates(self.targets[rows], self.joints[rows], self.commands[rows])


class Amplitudes(Enum):
    """How the amplitudes of turns are spread."""

    ALL_SCALES = "half of them over all scales, so that there are small ones while little is known"
    MOSTLY_LARGE = "nearly all of them large, because these tell most"


def orientations(
    count: int, tilt: float, seed: int, amplitudes: Amplitudes = Amplitudes.ALL_SCALES
) -> Array:
    """``count`` rotations (count, 3, 3): tilts up to ``tilt``, rad, after turns up to twice as far.

    ``count`` is a power of two, as Sobol' sequences want it.
    """
    from scipy.stats import qmc  # noqa: PLC0415 - half a second that only this function needs

    heading, tilted, about_z, twisted, scale = qmc.Sobol(5, seed=seed).random(count).T
    angle = tilt * _amplitudes(tilted, scale, amplitudes)
    sense = np.where(about_z < 0.5, -1.0, 1.0)
    twist = TWISTS_A_TILT * tilt * _amplitudes(twisted, scale, amplitudes) * sense
    heading, none = 2.0 * np.pi * heading, np.zeros(count)
    tilts = angle[:, None] * np.stack([np.cos(heading), np.sin(heading), none], axis=-1)
    twists = np.stack([none, none, twist], axis=-1)
    return rotations.from_vector(tilts) @ rotations.from_vector(twists)


def _amplitudes(evenly: Array, scale: Array, amplitudes: Amplitudes) -> Array:
    """Shares of the largest amplitude, from values spread evenly over 0 to 1."""
    few = amplitudes is Amplitudes.MOSTLY_LARGE
    return np.where(
        scale < (FEW_SMALL if few else MANY_SMALL),
        SMALLEST_SHARE ** (1.0 - evenly),
        np.sqrt(evenly) if few else evenly,
    )


def reachable_targets(
    belief: RobotBelief, targets: PoseBatch, mode: Array | None = None
) -> ReachableTargets:
    """Those of the poses that the estimated robot takes within its limits.

    On an assembly ``mode`` (1,), where one is named: to another no way leads.
    """
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, targets)
    rows = np.flatnonzero(within_limits(belief.limits, targets, joints))
    targets, joints = targets[rows], joints[rows]
    margin = belief.limits.singularity_margin
    arguments = (belief.mechanism, belief.estimate, targets, joints)
    clear, modes = margin_and_mode(*arguments, margin)
    if mode is not None:
        clear &= modes == mode
    return ReachableTargets(targets, joints)[clear]


def commands_for(belief: RobotBelief, stands: ReachableTargets) -> tuple[PoseBatch, Mask]:
    """The commands (n) that lead the controller to the joint variables of n poses, and which do.

    None does where the controller's own geometry cannot hold these joint variables, or only next to
    a singularity or in another assembly mode.
    """
    found = continue_solution(
        belief.mechanism,
        belief.controller,
        stands.joints,
        start=stands.targets,
        start_geometry=belief.estimate,
        start_joints=stands.joints,
        tries=COMMAND_TRIES,
    )
    back = belief.mechanism.inverse(belief.controller, belief.branch, found.poses)
    agrees = np.abs(np.nan_to_num(back, nan=np.inf) - stands.joints).max(axis=-1, initial=0.0) < 1e-6
    margin = belief.limits.singularity_margin
    held: Mask = agrees & has_singularity_margin(
        belief.mechanism, belief.controller, found.poses, stands.joints, margin
    )
    held &= found.found
    return found.poses, held


def outcomes_of(belief: RobotBelief, commands: PoseBatch) -> tuple[ReachableTargets, NDArray[np.intp]]:
    """Where commands lead the estimated robot, and the rows of those that do so within its limits."""
    joints = belief.mechanism.inverse(belief.controller, belief.branch, commands)
    rows = np.flatnonzero(within_limits(belief.limits, commands, joints))
    found = continue_solution(
        belief.mechanism,
        belief.estimate,
        joints[rows],
        start=commands[rows],
        start_geometry=belief.controller,
        start_joints=joints[rows],
    )
    margin = belief.limits.singularity_margin
    clear = found.found & has_singularity_margin(
        belief.mechanism, belief.estimate, found.poses, joints[rows], margin
    )
    return ReachableTargets(found.poses[clear], joints[rows[clear]]), rows[clear]


def reachable(belief: RobotBelief, targets: PoseBatch) -> Candidates:
    """Those of the poses that the estimated robot reaches within its limits, with their commands."""
    stands = reachable_targets(belief, targets)
    commands, held = commands_for(belief, stands)
    return Candidates(stands.targets, stands.joints, commands)[held]


def within_limits(limits: Limits, poses: PoseBatch, joints: Array) -> Mask:
    """Which poses keep to the tilt and joint limits; an unreachable one (NaN) does not."""
    in_range = (joints >= limits.joint_min_mm) & (joints <= limits.joint_max_mm)
    return in_range.all(axis=-1) & (poses.tilts() <= limits.tilt)
