"""What a simulated controller sends to its joints where its config has corrections.

It knows its own geometry and what its config says, and nothing of the machine. Forces follow from virtual
work: while the platform moves a little with the joints held, the forces of the legs do the work of the
weight. How the lengths change there is taken from differences of the mechanism's constraints.
"""

from __future__ import annotations

import numpy as np

from hexacell.config.interface import ControllerGeometry
from hexacell.kinematics import rotations
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

STEP = 1e-4
"""Of differences, mm, rad and the joints' unit."""

ROUNDS = 4
"""Of Newton's method, for joints a little off the inverse kinematics."""

RESTING = 1e-9
"""What is no motion of a joint, in its unit: the rounding of the inverse kinematics."""

UM = 1e-3


def with_longer_legs(
    mechanism: Mechanism, controller: ControllerGeometry, poses: PoseBatch, joints: Array
) -> Array:
    """Joints (n, 6) for legs as long as play and compliance make them; ``joints`` are those without."""
    corrections = controller.corrections
    if not any((*corrections.play_mm, *corrections.compliance_um_n)):
        return joints
    sent, found = joints.copy(), np.flatnonzero(~np.isnan(joints).any(axis=1))
    if found.size:
        sent[found] = _Statics(mechanism, controller, poses[found]).joints(joints[found])
    return sent


class _Statics:
    """The legs of a controller's geometry at n poses within reach."""

    def __init__(self, mechanism: Mechanism, controller: ControllerGeometry, poses: PoseBatch) -> None:
        self._mechanism = mechanism
        self._geometry = controller.geometry
        self._corrections = controller.corrections
        self._poses = poses

    def joints(self, joints: Array) -> Array:
        """The joints (n, 6) at which the legs close with their lengths under load."""
        forces = self._tensions(joints)
        play_mm = np.array(self._corrections.play_mm)
        by_force = UM * np.array(self._corrections.compliance_um_n) * self._corrections.weight_n
        # On which side a leg lies does not depend on how heavy the platform is.
        longer = 0.5 * play_mm * np.sign(forces) + by_force * forces
        sent = joints
        for _ in range(ROUNDS):
            error = self._lengths(self._poses, sent) - longer
            slope = self._lengths(self._poses, sent + STEP) - self._lengths(self._poses, sent - STEP)
            sent = sent - error * 2.0 * STEP / slope
        return sent

    def _lengths(self, poses: PoseBatch, joints: Array) -> Array:
        """By how much longer each leg (n, 6) would have to be to close, mm."""
        return self._mechanism.residual_and_jacobian(self._geometry, poses, joints)[0]

    def _tensions(self, joints: Array) -> Array:
        """Forces of the legs (n, 6) by a weight of one newton; positive where they pull."""
        by_pose, work = np.empty((len(joints), 6, 6)), np.empty((len(joints), 6))
        weight = np.array(self._corrections.weight_direction)
        for direction in range(6):
            forth, back = (self._moved(direction, sign * STEP) for sign in (1.0, -1.0))
            by_pose[:, :, direction] = self._lengths(forth, joints) - self._lengths(back, joints)
            way = self._centres(forth, joints) - self._centres(back, joints)
            work[:, direction] = way @ weight
        # At a singularity no forces hold every weight; the pseudoinverse gives those nearest to it.
        held: Array = np.linalg.pinv(np.swapaxes(by_pose, -1, -2)) @ work[..., None]
        return held[..., 0]

    def _moved(self, direction: int, step: float) -> PoseBatch:
        """The platforms a step along one of three axes, or turned about it at the ball."""
        along = step * np.eye(3)[direction % 3]
        if direction < 3:
            return PoseBatch(self._poses.positions + along, self._poses.rotations)
        return PoseBatch(self._poses.positions, rotations.from_vector(along) @ self._poses.rotations)

    def _centres(self, poses: PoseBatch, joints: Array) -> Array:
        """Where the weight acts (n, 3), in the base frame, on platforms that were moved."""
        stated = self._corrections.weight_centre_mm
        if stated is None:
            legs = self._mechanism.legs(self._geometry, self._poses, joints)
            arms = legs.platform_joints.mean(axis=1) - self._poses.positions
            own = np.einsum("nji,nj->ni", self._poses.rotations, arms)
        else:
            own = np.broadcast_to(np.array(stated), poses.positions.shape)
        return np.asarray(poses.positions + np.einsum("nij,nj->ni", poses.rotations, own))


def directions_on(path: Array, before: Array) -> Array:
    """In which direction each joint moved last at rows of a path (k, 6); ``before`` is that at the first.

    A joint that stands keeps its direction.
    """
    directions = np.empty_like(path)
    directions[0] = before
    for row, step in enumerate(np.diff(path, axis=0), start=1):
        directions[row] = np.where(np.abs(step) > RESTING, np.sign(step), directions[row - 1])
    return directions


def with_half_backlash(corrections: Corrections, path: Array, directions: Array) -> Array:
    """A path (k, 6) with each joint half of its backlash further in the direction of its motion."""
    return path + 0.5 * np.array(corrections.backlash) * directions
