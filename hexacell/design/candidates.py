"""Orientations to choose from, and the commands that would bring the robot there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell import kinematics, rotations
from hexacell.design.knowledge import Knowledge, Limits
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

NEAR_MM = 60.0
NEAR_TURN = 0.35
"""A command farther than this from the pose aimed at belongs to another assembly mode."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Poses that the robot can be brought to.

    Attributes:
        targets: poses aimed at, under the estimate.
        joints: joint variables (n, 6), mm, that take the estimated robot there.
        commands: poses that make the controller, with its own geometry, go to those joints.
    """

    targets: Poses
    joints: Array
    commands: Poses

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> Candidates:
        return Candidates(self.targets[rows], self.joints[rows], self.commands[rows])


def orientations(count: int, tilt: float, seed: int) -> Array:
    """``count`` rotations (count, 3, 3) that fill tilts up to ``tilt``, rad, and as large turns.

    Amplitudes are spread over all scales, so that there are small ones to choose while little is
    known and large ones later. ``count`` is a power of two, as Sobol' sequences want it.
    """
    from scipy.stats import qmc  # noqa: PLC0415 - half a second that only this function needs

    direction, size, turn = qmc.Sobol(3, seed=seed).random(count).T
    amplitude = tilt * (0.02 + 0.98 * size**2)
    heading = 2.0 * np.pi * direction
    about_z = amplitude * (2.0 * turn - 1.0)
    tilt_vectors = np.stack([np.cos(heading), np.sin(heading), np.zeros(count)], axis=-1)
    twist_vectors = np.stack([np.zeros(count), np.zeros(count), about_z], axis=-1)
    return rotations.from_vector(amplitude[:, None] * tilt_vectors) @ rotations.from_vector(twist_vectors)


def reachable(knowledge: Knowledge, targets: Poses) -> Candidates:
    """Those of the poses that the estimated robot reaches within its limits, with their commands.

    Left out are also poses that the controller's own geometry cannot hold, or only next to a
    singularity or in another assembly mode: there no command leads to these joint variables.
    """
    joints = knowledge.mechanism.inverse(knowledge.estimate, knowledge.branch, targets)
    rows = np.flatnonzero(within_limits(knowledge.limits, targets, joints))
    targets, joints = targets[rows], joints[rows]
    clear = _clear(knowledge, targets, joints)
    targets, joints = targets[clear], joints[clear]
    commands = kinematics.follow(
        knowledge.mechanism,
        knowledge.controller,
        joints,
        start=targets,
        start_geometry=knowledge.estimate,
        start_joints=joints,
    )
    held = commands.found & _held_by_controller(knowledge, commands.poses, targets, joints)
    return Candidates(targets, joints, commands.poses)[held]


def within_limits(limits: Limits, poses: Poses, joints: Array) -> Mask:
    """Which poses keep to the tilt and joint limits; an unreachable one (NaN) does not."""
    in_range = (joints >= limits.joint_min_mm) & (joints <= limits.joint_max_mm)
    return in_range.all(axis=-1) & (poses.tilts() <= limits.tilt)


def _clear(knowledge: Knowledge, poses: Poses, joints: Array) -> Mask:
    margin = kinematics.singularity_margin(knowledge.mechanism, knowledge.estimate, poses, joints)
    return margin >= knowledge.limits.singularity_margin


def _held_by_controller(knowledge: Knowledge, commands: Poses, targets: Poses, joints: Array) -> Mask:
    back = knowledge.mechanism.inverse(knowledge.controller, knowledge.branch, commands)
    agrees = np.abs(np.nan_to_num(back, nan=np.inf) - joints).max(axis=-1, initial=0.0) < 1e-6
    moved = np.linalg.norm(commands.positions - targets.positions, axis=-1)
    turned = np.linalg.norm(
        rotations.to_vector(commands.rotations @ np.swapaxes(targets.rotations, -1, -2)), axis=-1
    )
    margin = kinematics.singularity_margin(knowledge.mechanism, knowledge.controller, commands, joints)
    clear = margin >= knowledge.limits.singularity_margin
    held: Mask = agrees & (moved < NEAR_MM) & (turned < NEAR_TURN) & clear
    return held
