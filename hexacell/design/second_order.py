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
from hexacell.geometry import Geometry
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
    possible, deviations = np.ones(len(stands), dtype=bool), []
    for draw in _draws(len(knowledge.free)) @ np.linalg.cholesky(knowledge.covariance).T:
        change = knowledge.basis @ draw
        result = kinematics.forward(
            knowledge.mechanism,
            Geometry.from_vector(knowledge.estimate.vector() + change),
            joints,
            kinematics.moved(poses, known.parameters @ change),
            mode=known.mode,
        )
        if result.found[0]:
            possible &= result.found[1:]
            deviations.append(result.poses.positions[1:] - result.poses.positions[0])
        if not possible.any():
            break
    turned = known.parameters[0, 3:] @ knowledge.basis
    uncertain = np.sqrt(np.einsum("ip,pq,iq->i", turned, knowledge.covariance, turned).max())
    travel = knowledge.limits.gauge_travel_mm / (1.0 + uncertain / HALF_AT)
    return possible & _all_inside(np.array(deviations), travel)


def _all_inside(deviations: Array, travel_mm: float) -> Mask:
    """Whether deviations (robots, n, 3), mm, stay inside, and those of robots not drawn would too."""
    if len(deviations) < FEWEST:
        return np.zeros(deviations.shape[1] if deviations.ndim > 1 else 1, dtype=bool)
    unlucky = np.abs(deviations.mean(axis=0)) + SIGMAS * deviations.std(axis=0)
    farthest = np.maximum(unlucky, np.abs(deviations).max(axis=0)).max(axis=-1)
    inside: Mask = farthest <= travel_mm
    return inside


@lru_cache
def _draws(count: int) -> Array:
    """The same for every choice, so that a choice can be made again: (robots, count), antithetic."""
    half = np.random.default_rng(0).standard_normal((ROBOTS // 2, count))
    return np.concatenate([half, -half])
