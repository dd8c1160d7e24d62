"""Whether deviations stay inside the travel where straight-line error propagation does not hold.

While little is known, the platform may stand many degrees from where the estimate puts it, and the
predicted deviation is far from linear in the parameters. Robots are drawn from what is known, and
each is asked where it would really go.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hexacell.experiment_design.candidates import ReachableTargets
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.forward import apply_twist, forward_kinematics
from hexacell.kinematics.geometry import GeometryBatch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import Sensitivity, has_singularity_margin, pose_sensitivity

ROBOTS = 24
MANY_ROBOTS = 240
LITTLE_KNOWN = np.radians(3.0)
"""Uncertainty of the platform's orientation beyond which many robots are drawn. Under the drawing's
tolerances one robot in a hundred then strays twenty times as far as straight propagation says."""

NEARLY_ALL_SHARE = 0.4
"""Of the travel. Nearly all of many robots, all but the worst, stay within it: of 1,000 others none left
the travel."""

FEWEST = 6
"""Robots that can stand at the reference; of fewer nothing can be said."""

DRAWN_MARGIN_SHARE = 0.5
"""Of the singularity margin, kept by all drawn robots that are not the estimated one."""

SIGMAS = 4.0
"""So far the deviations of a robot that was not drawn are supposed to scatter."""

HALF_AT = np.radians(6.0)
"""Uncertainty of the platform's orientation at which only half of the travel may be used: the less is
known, the heavier the tails are."""


def stays_in_travel(
    belief: RobotBelief, reference_joints: Array, reference: PoseBatch, stands: ReachableTargets
) -> Mask:
    """Which of n poses keep the ball inside the travel on every robot that may be the true one.

    The gauges are zeroed at the ``reference`` pose, where the sliders stand at ``reference_joints``
    (6,), mm. A robot that cannot take the reference pose is not the true one.
    """
    joints = np.concatenate([reference_joints[None], stands.joints])
    poses = PoseBatch(
        np.concatenate([reference.positions, stands.targets.positions]),
        np.concatenate([reference.rotations, stands.targets.rotations]),
    )
    # The reference is where the records of its point say it was, which is not quite where it closes.
    poses = forward_kinematics(belief.mechanism, belief.estimate, joints, poses).poses
    known = pose_sensitivity(belief.mechanism, belief.estimate, poses, joints)
    turn = _turn_sigma(belief, known)
    if turn > LITTLE_KNOWN:
        return _nearly_all_near(_drawn(belief, MANY_ROBOTS, joints, poses, known), belief)
    drawn = _drawn(belief, ROBOTS, joints, poses, known)
    stays: Mask = np.all(drawn.found, axis=0)
    travel = belief.limits.gauge_travel_mm / (1.0 + turn / HALF_AT)
    stays &= _all_inside(drawn.deviations, travel)
    return stays


def orientation_sigma(belief: RobotBelief, stands: ReachableTargets) -> float:
    """How surely the platform's orientation is known at the first of some poses: one sigma, rad.

    About the base axis about which it is known least.
    """
    known = pose_sensitivity(belief.mechanism, belief.estimate, stands.targets, stands.joints)
    return _turn_sigma(belief, known)


def _turn_sigma(belief: RobotBelief, known: Sensitivity) -> float:
    turned = known.parameters[0, 3:] @ belief.basis
    return float(np.sqrt(np.einsum("ip,pq,iq->i", turned, belief.covariance, turned).max()))


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """Robots (r) that can stand at the reference, asked for n poses.

    Attributes:
        found: (r, n) whether they can take them clear of singularities; ``deviations`` (r, n, 3), mm.
    """

    found: Mask
    deviations: Array


def _drawn(belief: RobotBelief, robots: int, joints: Array, poses: PoseBatch, known: Sensitivity) -> _Drawn:
    """Where robots drawn from what is known stand; the first of the poses is the reference."""
    root = np.linalg.cholesky(belief.covariance)
    changes = _draws(robots, len(belief.free)) @ root.T @ belief.basis.T
    count = len(joints)
    steps = np.einsum("nip,rp->rni", known.parameters, changes).reshape(-1, 6)
    again = np.tile(np.arange(count), robots)
    geometries = GeometryBatch.from_vectors((belief.estimate.vector() + changes).repeat(count, axis=0))
    result = forward_kinematics(
        belief.mechanism,
        geometries,
        joints[again],
        apply_twist(poses[again], steps),
        mode=known.mode[again],
    )
    found = result.found.reshape(robots, count)
    first = np.arange(robots) * count
    # One that would stand next to a singularity there is refused before anything moves.
    stands = found[:, 0] & has_singularity_margin(
        belief.mechanism,
        geometries[first],
        result.poses[first],
        joints[np.zeros(robots, dtype=int)],
        belief.limits.singularity_margin,
    )
    found &= has_singularity_margin(
        belief.mechanism,
        geometries,
        result.poses,
        joints[again],
        DRAWN_MARGIN_SHARE * belief.limits.singularity_margin,
    ).reshape(robots, count)
    positions = result.poses.positions.reshape(robots, count, 3)[stands]
    return _Drawn(found[stands, 1:], positions[:, 1:] - positions[:, :1])


def _nearly_all_near(drawn: _Drawn, belief: RobotBelief) -> Mask:
    """Which of the poses all robots but the worst take without straying far."""
    if len(drawn.found) < FEWEST:
        return np.zeros(drawn.found.shape[1], dtype=bool)
    farthest = np.where(drawn.found, np.abs(drawn.deviations).max(axis=-1), np.inf)
    near: Mask = np.sort(farthest, axis=0)[-2] <= NEARLY_ALL_SHARE * belief.limits.gauge_travel_mm
    return near


def _all_inside(deviations: Array, travel_mm: float) -> Mask:
    """Whether deviations (robots, n, 3), mm, stay inside, and those of robots not drawn would too."""
    if len(deviations) < FEWEST:
        return np.zeros(deviations.shape[1], dtype=bool)
    unlucky = np.abs(deviations.mean(axis=0)) + SIGMAS * deviations.std(axis=0)
    farthest = np.maximum(unlucky, np.abs(deviations).max(axis=0)).max(axis=-1)
    inside: Mask = farthest <= travel_mm
    return inside


@lru_cache
def _draws(robots: int, count: int) -> Array:
    """The same for every choice, so that a choice can be made again: (robots, count), antithetic."""
    half = np.random.default_rng(0).standard_normal((robots // 2, count))
    return np.concatenate([half, -half])
