"""The chance constraint on the gauges' travel, evaluated by Monte Carlo where it is not linear.

A pose may be measured if the ball almost surely stays inside the gauges' travel there. The deviation d of
the ball from the reference depends on the unknown parameters theta, of which the belief is a normal
distribution; the constraint is P(|d(theta)| <= travel) >= 1 - epsilon on each axis.

Near the reference d is linear in theta, and propagation of covariance gives its distribution
(:meth:`PredictedRecords.within <hexacell.experiment_design.predicted_records.PredictedRecords.within>`).
While little is known it is far from linear: the platform's orientation may be wrong by many degrees. Then
robots are sampled from the belief and the forward kinematics of each is solved, as in the scenario
approach to chance constraints (Calafiore & Campi, IEEE Trans. Automatic Control 51, 2006), with antithetic
variates. How cautious the evaluation is depends on the standard deviation s of the orientation:

- s <= ``uncertain_sigma``: few samples. All of them, and their mean and ``sigmas`` standard deviations,
  must be inside ``travel / (1 + s / half_travel_sigma)``: the less is known, the heavier the tails.
- above: many samples, of which all but the worst must stay within ``uncertain_share`` of the travel.

The constants were chosen so that of 1,000 simulated robots none left the travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hexacell.experiment_design.candidates import ReachableTargets
from hexacell.experiment_design.predicted_records import GaugeZero, PredictedRecords, predict_records
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.forward import apply_twist, forward_kinematics
from hexacell.kinematics.geometry import GeometryBatch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import Sensitivity, has_singularity_margin, pose_sensitivity
from hexacell.motion.paths import Path


@dataclass(frozen=True, slots=True)
class TravelCheckSettings:
    """Constants of the evaluation; standard deviations of the platform's orientation in rad.

    Attributes:
        linear_share: of the travel. Within it, at four sigma, linear propagation is believed unless the
            orientation is uncertain: the ball stays inside even if the prediction is wrong by a factor
            of two.
        uncertain_sigma: standard deviation beyond which the orientation is uncertain. Under the drawing's
            tolerances one robot in a hundred then deviates twenty times as far as linear propagation says.
        samples: robots sampled, and ``samples_uncertain`` where the orientation is uncertain.
        uncertain_share: of the travel, where the orientation is uncertain.
        half_travel_sigma: standard deviation at which half of the travel may be used.
        sigmas: standard deviations of the sampled deviations that must be inside the travel.
        fewest_samples: sampled robots that can take the reference pose; fewer are not sufficient.
        margin_share: of the singularity margin, which all sampled robots must keep.
    """

    linear_share: float = 0.4
    uncertain_sigma: float = float(np.radians(3.0))
    samples: int = 24
    samples_uncertain: int = 240
    uncertain_share: float = 0.4
    half_travel_sigma: float = float(np.radians(6.0))
    sigmas: float = 4.0
    fewest_samples: int = 6
    margin_share: float = 0.5


SETTINGS = TravelCheckSettings()


@dataclass(frozen=True, eq=False)
class TravelConstraint:
    """The chance constraint at a point whose gauges were zeroed at ``zero``."""

    belief: RobotBelief
    zero: GaugeZero
    settings: TravelCheckSettings = SETTINGS

    def holds(self, records: PredictedRecords) -> Mask:
        """At which of n predicted records the ball almost surely stays inside the travel."""
        holds = self._holds_linearly(records)
        if not holds.all():
            holds[~holds] = self._holds_for_samples(records.targets[~holds])
        return holds

    def holds_along(self, path: Path) -> bool:
        """Whether the ball almost surely stays inside along a path.

        Every other pose is checked, the last included: from one to the next little changes.
        """
        targets = ReachableTargets(path.poses[slice(None, None, -2)], path.joints[::-2])
        linear = self._holds_linearly(predict_records(self.belief, self.zero, targets))
        return bool(linear.all() or self._holds_for_samples(targets[~linear]).all())

    def _holds_linearly(self, records: PredictedRecords) -> Mask:
        if self._is_uncertain:
            return np.zeros(len(records), dtype=bool)
        return records.within(self.settings.linear_share * self.belief.limits.gauge_travel_mm)

    def _holds_for_samples(self, targets: ReachableTargets) -> Mask:
        return stays_in_travel(
            self.belief, self.zero.joints, self.zero.target.poses, targets, self.settings
        )

    @cached_property
    def _is_uncertain(self) -> bool:
        return orientation_sigma(self.belief, self.zero.target) > self.settings.uncertain_sigma


def stays_in_travel(
    belief: RobotBelief,
    reference_joints: Array,
    reference: PoseBatch,
    targets: ReachableTargets,
    settings: TravelCheckSettings = SETTINGS,
) -> Mask:
    """At which of n targets the ball stays inside the travel on the robots sampled from the belief.

    The gauges are zeroed at the ``reference`` pose (1), where the joint variables are
    ``reference_joints`` (6,), mm. Samples that cannot take it are dropped: the true robot could.
    """
    joints = np.concatenate([reference_joints[None], targets.joints])
    poses = PoseBatch.concatenate((reference, targets.poses))
    # The reference is estimated from its records, so that it closes the legs only approximately.
    poses = forward_kinematics(belief.mechanism, belief.estimate, joints, poses).poses
    sensitivity = pose_sensitivity(belief.mechanism, belief.estimate, poses, joints)
    sigma = _orientation_sigma(belief, sensitivity)
    is_uncertain = sigma > settings.uncertain_sigma
    samples = settings.samples_uncertain if is_uncertain else settings.samples
    sampled = _sample(belief, samples, joints, poses, sensitivity, settings)
    if len(sampled.found) < settings.fewest_samples:
        return np.zeros(len(targets), dtype=bool)
    travel = belief.limits.gauge_travel_mm
    if is_uncertain:
        return _nearly_all_within(sampled, settings.uncertain_share * travel)
    return _all_within(sampled, travel / (1.0 + sigma / settings.half_travel_sigma), settings.sigmas)


def orientation_sigma(belief: RobotBelief, targets: ReachableTargets) -> float:
    """Standard deviation, rad, of the platform's orientation at the first of some targets.

    About the base axis about which it is known least.
    """
    sensitivity = pose_sensitivity(belief.mechanism, belief.estimate, targets.poses, targets.joints)
    return _orientation_sigma(belief, sensitivity)


def _orientation_sigma(belief: RobotBelief, sensitivity: Sensitivity) -> float:
    rotation = sensitivity.parameters[0, 3:] @ belief.basis
    return float(np.sqrt(np.einsum("ip,pq,iq->i", rotation, belief.covariance, rotation).max()))


@dataclass(frozen=True, slots=True, eq=False)
class _SampledRobots:
    """Robots (r) that can take the reference pose, at n targets.

    Attributes:
        found: (r, n) whether they take the target clear of singularities.
        deviations: (r, n, 3), mm, from the reference.
    """

    found: Mask
    deviations: Array


def _sample(
    belief: RobotBelief,
    samples: int,
    joints: Array,
    poses: PoseBatch,
    sensitivity: Sensitivity,
    settings: TravelCheckSettings,
) -> _SampledRobots:
    """Solve n poses, the reference first, for robots sampled from the belief."""
    root = np.linalg.cholesky(belief.covariance)
    errors = _standard_normal(samples, len(belief.free)) @ root.T @ belief.basis.T
    count, margin = len(joints), belief.limits.singularity_margin
    # Newton's method starts where linear propagation puts the pose of each robot.
    steps = np.einsum("nip,rp->rni", sensitivity.parameters, errors).reshape(-1, 6)
    rows = np.tile(np.arange(count), samples)
    vectors = (belief.estimate.vector + errors).repeat(count, axis=0)
    robots = GeometryBatch(belief.mechanism.parameters, vectors)
    start, mode = apply_twist(poses[rows], steps), sensitivity.mode[rows]
    result = forward_kinematics(belief.mechanism, robots, joints[rows], start, mode=mode)
    found = result.found.reshape(samples, count)
    first = np.arange(samples) * count
    at_reference = (robots.subset(first), result.poses[first], joints[np.zeros(samples, dtype=int)], margin)
    # A robot next to a singularity at its reference is refused before anything moves.
    kept = found[:, 0] & has_singularity_margin(belief.mechanism, *at_reference)
    everywhere = (robots, result.poses, joints[rows], settings.margin_share * margin)
    found &= has_singularity_margin(belief.mechanism, *everywhere).reshape(samples, count)
    positions = result.poses.positions.reshape(samples, count, 3)[kept]
    return _SampledRobots(found[kept, 1:], positions[:, 1:] - positions[:, :1])


def _nearly_all_within(sampled: _SampledRobots, distance_mm: float) -> Mask:
    """At which targets all sampled robots but the worst stay within a distance."""
    farthest = np.where(sampled.found, np.abs(sampled.deviations).max(axis=-1), np.inf)
    within: Mask = np.sort(farthest, axis=0)[-2] <= distance_mm
    return within


def _all_within(sampled: _SampledRobots, distance_mm: float, sigmas: float) -> Mask:
    """At which targets all sampled robots, and those that some sigmas predict, stay within a distance."""
    deviations = sampled.deviations
    predicted = np.abs(deviations.mean(axis=0)) + sigmas * deviations.std(axis=0)
    farthest = np.maximum(predicted, np.abs(deviations).max(axis=0)).max(axis=-1)
    within: Mask = np.all(sampled.found, axis=0) & (farthest <= distance_mm)
    return within


@lru_cache
def _standard_normal(samples: int, count: int) -> Array:
    """(samples, count) antithetic normal variates, the same ones every time: choices can be repeated."""
    half = np.random.default_rng(0).standard_normal((samples // 2, count))
    return np.concatenate([half, -half])
