"""How six legs close, for bodies that are nowhere exactly as drawn: kinematics that owe nothing to the
code under test.

Leg i closes when the distance between its slider joint and its platform joint is its length. Joints and
lengths may be different at every stop, as those of a real machine are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

STAGES = 24
STEPS = 30
CLOSED_MM = 1e-10


class CannotCloseError(Exception):
    """The legs do not close near the pose where they should."""


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """What six legs join at n stops.

    Attributes:
        sliders: joints on the sliders (n, 6, 3), base frame, mm.
        platform: joints on the platform (n, 6, 3), platform frame, mm.
        lengths: (n, 6), mm.
    """

    sliders: Array
    platform: Array
    lengths: Array

    @classmethod
    def of(cls, geometry: Geometry, joints: Array) -> Bodies:
        """Those of a machine exactly as its geometry says, with sliders at ``joints`` (n, 6), mm."""
        sliders = geometry["S"] + joints[..., None] * np.array([1.0, 0.0, 0.0])
        shape = (len(joints), 6)
        return cls(
            sliders, np.broadcast_to(geometry["B"], (*shape, 3)), np.broadcast_to(geometry["l"], shape)
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> Bodies:
        return Bodies(self.sliders[rows], self.platform[rows], self.lengths[rows])

    def moved_with(self, before: Bodies, after: Bodies) -> Bodies:
        """These, changed as others change from ``before`` to ``after``."""
        return Bodies(
            self.sliders + after.sliders - before.sliders,
            self.platform + after.platform - before.platform,
            self.lengths + after.lengths - before.lengths,
        )

    def blend(self, other: Bodies, share: float) -> Bodies:
        """Bodies between these and others."""
        pairs = (
            (self.sliders, other.sliders),
            (self.platform, other.platform),
            (self.lengths, other.lengths),
        )
        return Bodies(*((1.0 - share) * here + share * there for here, there in pairs))

    def arms(self, poses: PoseBatch) -> Array:
        """From the ball to the platform joints (n, 6, 3), in the base frame, mm."""
        arms: Array = np.einsum("nij,nlj->nli", poses.rotations, self.platform)
        return arms

    def directions(self, poses: PoseBatch) -> tuple[Array, Array]:
        """Unit vectors (n, 6, 3) from platform joint to slider joint, and the distances (n, 6), mm."""
        between = self.sliders - poses.positions[:, None] - self.arms(poses)
        distances = np.linalg.norm(between, axis=-1)
        return between / distances[..., None], distances


def slider_places(geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
    """Where the sliders (n, 6) stand, mm, at n poses of a machine that is as its geometry says.

    Raises:
        CannotCloseError: a leg is too short.
    """
    ends = poses.positions[:, None] + np.einsum("nij,lj->nli", poses.rotations, geometry["B"])
    away = ends - geometry["S"]
    along = geometry["l"] ** 2 - away[..., 1] ** 2 - away[..., 2] ** 2
    if (along < 0.0).any():
        raise CannotCloseError("a leg is too short for a commanded pose")
    places: Array = away[..., 0] + np.array(branch) * np.sqrt(along)
    return places


def close(bodies: Bodies, near: PoseBatch) -> PoseBatch:
    """The poses (n) near others that close all legs, by Newton's method on the legs' lengths.

    Raises:
        CannotCloseError: there is none.
    """
    positions, rotations = near.positions.copy(), near.rotations.copy()
    for _ in range(STEPS):
        poses = PoseBatch(positions, rotations)
        toward, distances = bodies.directions(poses)
        errors = distances - bodies.lengths
        if np.abs(errors).max() < CLOSED_MM:
            return poses
        jacobian = np.concatenate([-toward, -np.cross(bodies.arms(poses), toward)], axis=-1)
        step = -np.linalg.solve(jacobian, errors[..., None])[..., 0]
        if not np.isfinite(step).all() or np.abs(step[:, 3:]).max() > 1.0:
            break
        positions = positions + step[:, :3]
        rotations = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ rotations
    raise CannotCloseError("the legs do not close near the expected pose")


def follow(start: Bodies, end: Bodies, poses: PoseBatch, stages: int = STAGES) -> PoseBatch:
    """Poses of ``end``, bent in small stages from ``start``, whose poses are known.

    Raises:
        CannotCloseError: a singularity is on the way.
    """
    for stage in range(1, stages + 1):
        poses = close(start.blend(end, stage / stages), poses)
    return poses


def leg_forces(bodies: Bodies, poses: PoseBatch, weight: Array, centre: Array) -> Array:
    """Tension (n, 6), N, of the legs that carry a ``weight`` (3,), N, in the base frame.

    It acts at ``centre`` (3,), mm, in the platform frame; neither joints nor air give a moment.
    """
    toward, _ = bodies.directions(poses)
    wrench = np.concatenate([toward, np.cross(bodies.arms(poses), toward)], axis=-1)
    arm = poses.rotations @ centre
    load = np.concatenate([np.broadcast_to(weight, arm.shape), np.cross(arm, weight)], axis=-1)
    forces: Array = -np.linalg.solve(np.swapaxes(wrench, -1, -2), load[..., None])[..., 0]
    return forces
