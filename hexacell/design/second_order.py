"""Whether deviations stay inside the travel where straight-line error propagation does not hold.

While little is known, the platform may stand many degrees from where the estimate puts it, and the
predicted deviation is far from linear in the parameters. Robots are drawn from what is known, and
each is asked where it would really go.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from hexacell import kinematics
from hexacell.design.candidates import Standing
from hexacell.design.knowledge import Knowledge
from hexacell.geometry import Geometries
from hexacell.kinematics import Forward, Sensitivity
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

ROBOTS = 24
FEWEST = 6
"""Robots that can stand at the reference; of fewer nothing can be said."""

SIGMAS = 4.0
"""So far the deviations of a robot that was not drawn are supposed to scatter."""

HALF_AT = np.radians(6.0)
"""Uncertainty of the platform's orientation at which only half of the travel may be used: the less is
known, the heavier the tails are."""


def inside(knowledge: Knowledge, reference_joints: Array, reference: Poses, stands: Standing) -> Mask:
    """Which of n poses keep the ball inside the travel on every robot that may be the true one.

    The gauges are zeroed at the ``reference`` pose, where the sliders stand at ``reference_joints``
    (6,), mm. A robot that cannot take the reference pose is not the true one.
    """
    joints = np.concatenate([reference_joints[None], stands.joints])
    poses = Poses(
        np.concatenate([reference.positions, stands.targets.positions]),
        np.concatenate([reference.rotations, stands.targets.rotations]),
    )
    # The reference is where the records of its point say it was, which is not quite where it closes.
    poses = kinematics.forward(knowledge.mechanism, knowledge.estimate, joints, poses).poses
    known = kinematics.sensitivity(knowledge.mechanism, knowledge.estimate, poses, joints)
    changes = _draws(len(knowledge.free)) @ np.linalg.cholesky(knowledge.covariance).T @ knowledge.basis.T
    drawn = _drawn(knowledge, changes, joints, poses, known)
    found = drawn.found.reshape(len(changes), -1)
    positions = drawn.poses.positions.reshape(len(changes), -1, 3)[found[:, 0]]
    possible = np.all(found[found[:, 0]], axis=0)[1:]
    turned = known.parameters[0, 3:] @ knowledge.basis
    uncertain = np.sqrt(np.einsum("ip,pq,iq->i", turned, knowledge.covariance, turned).max())
    travel = knowledge.limits.gauge_travel_mm / (1.0 + uncertain / HALF_AT)
    inside: Mask = possible & _all_inside(positions[:, 1:] - positions[:, :1], travel)
    return inside


def _drawn(
    knowledge: Knowledge, changes: Array, joints: Array, poses: Poses, known: Sensitivity
) -> Forward:
    """Where robots whose parameters differ by ``changes`` (r, 42), mm, stand: (r n) poses."""
    robots, count = len(changes), len(joints)
    steps = np.einsum("nip,rp->rni", known.parameters, changes).reshape(-1, 6)
    again = np.tile(np.arange(count), robots)
    return kinematics.forward(
        knowledge.mechanism,
        Geometries.from_vectors((knowledge.estimate.vector() + changes).repeat(count, axis=0)),
        joints[again],
        kinematics.moved(poses[again], steps),
        mode=known.mode[again],
    )


def _all_inside(deviations: Array, travel_mm: float) -> Mask:
    """Whether deviations (robots, n, 3), mm, stay inside, and those of robots not drawn would too."""
    if len(deviations) < FEWEST:
        return np.zeros(deviations.shape[1], dtype=bool)
    unlucky = np.abs(deviations.mean(axis=0)) + SIGMAS * deviations.std(axis=0)
    farthest = np.maximum(unlucky, np.abs(deviations).max(axis=0)).max(axis=-1)
    inside: Mask = farthest <= travel_mm
    return inside


@lru_cache
def _draws(count: int) -> Array:
    """The same for every choice, so that a choice can be made again: (robots, count), antithetic."""
    half = np.random.default_rng(0).standard_normal((ROBOTS // 2, count))
    return np.concatenate([half, -half])
