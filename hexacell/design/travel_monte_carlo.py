"""The chance constraint on the gauges' travel, evaluated by Monte Carlo where it is not linear.

A pose may be measured if the ball almost surely stays inside the gauges' travel there. The deviation d of
the ball from the reference depends on the unknown parameters theta, of which the belief is a normal
distribution; the constraint is P(|d(theta)| <= travel) >= 1 - epsilon on each axis. Passive joints and legs
keep their limits as surely.

Near the reference d is linear in theta, and propagation of covariance gives its distribution
(:meth:`PredictedRecords.within <hexacell.design.predicted_records.PredictedRecords.within>`).
While little is known it is far from linear: the platform's orientation may be wrong by many degrees. Then
robots are sampled from the belief and the forward kinematics of each is solved, as in the scenario
approach to chance constraints (Calafiore & Campi, IEEE Trans. Automatic Control 51, 2006), with antithetic
variates. How cautious the evaluation is depends on the standard deviation s of the orientation:

- s <= ``UNCERTAIN_SIGMA``: few samples. All of them, and their mean and ``SIGMAS`` standard deviations,
  must be inside ``travel / (1 + s / HALF_TRAVEL_SIGMA)``: the less is known, the heavier the tails. Of what
  passive joints have left few samples show too little in some directions, and just such poses would be
  chosen: there ``MARGIN_SIGMAS`` standard deviations by linear propagation count.
- above: many samples, of which all but the worst must stay within ``UNCERTAIN_SHARE`` of the travel.

The constants were chosen so that of 1,000 simulated robots none left the travel.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hexacell.design import predicted_records
from hexacell.design.candidates import ReachableTargets
from hexacell.identification.belief import SPARE_ANGLE, SPARE_SIGMAS, UNCERTAIN_SIGMA, RobotBelief
from hexacell.kinematics.forward import apply_twist, forward_kinematics
from hexacell.kinematics.geometry import GeometryBatch
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import FreeSensitivity, free_sensitivity, has_singularity_margin
from hexacell.limits.limits import Limits
from hexacell.motion.paths import Path

LINEAR_SHARE = 0.4
"""Share of the travel. Within it, at four sigma, linear propagation is believed unless the orientation is
uncertain: the ball stays inside even if the prediction is wrong by a factor of two."""

HALF_TRAVEL_SIGMA = float(np.radians(6.0))
"""Standard deviation of the orientation, rad, at which half of the travel may be used."""

UNCERTAIN_SHARE = 0.4
"""Share of the travel that may be used where the orientation is uncertain."""

SAMPLES = 24
SAMPLES_UNCERTAIN = 240
STAGES_UNCERTAIN = (24, 96)
"""After how many samples the targets that they exclude are left out."""

SIGMAS = 4.0

MARGIN_SIGMAS = 5.0
"""Standard deviations, by linear propagation, of what passive joints and legs have left. After the first
dozen of poses its errors are up to 1.45 times as large: second derivatives count while so much is open."""

FEWEST_SAMPLES = 6
"""Sampled robots that can take the reference pose; fewer are not sufficient."""

MARGIN_SHARE = 0.5
"""Share of the singularity margin that all sampled robots must keep."""

TOLERANCE_MM = 1e-4
"""Largest constraint of sampled robots, whose deviations are compared with millimetres of travel."""


@dataclass(frozen=True, eq=False)
class TravelConstraint:
    """The chance constraint at a point whose gauges were zeroed at ``zero``."""

    belief: RobotBelief
    zero: predicted_records.GaugeZero

    def holds(self, records: predicted_records.PredictedRecords) -> Mask:
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
        linear = self._holds_linearly(predicted_records.predict_records(self.belief, self.zero, targets))
        return bool(linear.all() or self._holds_for_samples(targets[~linear]).all())

    def _holds_linearly(self, records: predicted_records.PredictedRecords) -> Mask:
        if self.is_uncertain:
            return np.zeros(len(records), dtype=bool)
        return records.within(self.belief.limits, LINEAR_SHARE) & self._legs_are_free(records.targets)

    def _legs_are_free(self, targets: ReachableTargets) -> Mask:
        """At which of n targets passive joints have angles left for the orientation's uncertainty."""
        belief, sigma = self.belief, self._orientation_sigma
        wanted = belief.margins_for(SPARE_ANGLE + SPARE_SIGMAS * sigma)
        at = (belief.mechanism, belief.estimate, targets.poses, targets.joints)
        return belief.limits.allow_legs(*at, wanted)

    def _holds_for_samples(self, targets: ReachableTargets) -> Mask:
        """At which of n targets the constraint holds on the robots sampled from the belief."""
        belief, zero = self.belief, self.zero
        joints = np.concatenate([zero.joints[None], targets.joints])
        poses = PoseBatch.joined((zero.target.poses, targets.poses))
        # The reference is estimated from its records, so that it closes the legs only approximately.
        poses = forward_kinematics(belief.mechanism, belief.estimate, joints, poses).poses
        sensitivity = free_sensitivity(belief.mechanism, belief.estimate, poses, joints)
        scenario = _Scenario(belief, zero, joints, poses, sensitivity)
        sigma = float(belief.orientation_sigmas(sensitivity[:1])[0])
        if sigma > UNCERTAIN_SIGMA:
            return scenario.nearly_all_hold()
        every = np.arange(len(targets))
        robots = scenario.sampled(_standard_normal(SAMPLES, len(belief.free)), every)
        if len(robots) < FEWEST_SAMPLES:
            return np.zeros(len(targets), dtype=bool)
        share = 1.0 / (1.0 + sigma / HALF_TRAVEL_SIGMA)
        holds = _all_within(robots, belief.limits, scenario.chance_spread(every), share)
        holds[holds] = self._margins_suffice(targets[holds])
        return holds

    def _margins_suffice(self, targets: ReachableTargets) -> Mask:
        """At which of n targets passive joints and legs have enough left for what is not known of them."""
        belief, suffice = self.belief, self._legs_are_free(targets)
        if suffice.all():
            return suffice
        near = targets[~suffice]
        at = (belief.mechanism, belief.estimate, near.poses, near.joints)
        sigmas = belief.margin_sigmas(near.poses, near.joints, free_sensitivity(*at))
        wanted = np.maximum(belief.least_margins, MARGIN_SIGMAS * sigmas)
        suffice[~suffice] = (belief.limits.leg_margins(*at) >= wanted).all(axis=-1)
        return suffice

    @cached_property
    def is_uncertain(self) -> bool:
        """Whether so little is known that targets take many samples; they cost less together."""
        return self._orientation_sigma > UNCERTAIN_SIGMA

    @cached_property
    def _orientation_sigma(self) -> float:
        target = self.zero.target
        return self.belief.orientation_sigma(target.poses, target.joints)


@dataclass(frozen=True, slots=True, eq=False)
class _SampledRobots(Batch):
    """Robots (r) that can take the reference pose, at n targets.

    Attributes:
        found: (r, n) whether they take the target clear of singularities.
        deviations: (r, n, 3), mm, from the reference.
        leg_margins: (r, n, m) of passive joints and legs; see
            :meth:`~hexacell.limits.limits.Limits.leg_margins`.
    """

    found: Mask
    deviations: Array
    leg_margins: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Scenario:
    """The reference, first, and n targets of the estimated robot, for robots sampled from the belief."""

    belief: RobotBelief
    zero: predicted_records.GaugeZero
    joints: Array
    poses: PoseBatch
    sensitivity: FreeSensitivity

    def chance_spread(self, targets: NDArray[np.intp]) -> Array:
        """How far the gauges may be off by chance (n, 3), mm, at some of the targets."""
        covariance = self.belief.noise.chance_covariance(self.sensitivity.joints[1 + targets, :3])
        return predicted_records.CHANCE_SIGMAS * self.belief.limits.sigma_along_gauges(
            covariance + self.zero.covariance
        )

    def nearly_all_hold(self) -> Mask:
        """At which targets (n,) the constraint holds on all of many sampled robots but the worst.

        A few robots are tried first: most targets are excluded by them already.
        """
        possible = np.arange(len(self.joints) - 1)
        robots: _SampledRobots | None = None
        every = _standard_normal(SAMPLES_UNCERTAIN, len(self.belief.free))
        for variates in np.split(every, STAGES_UNCERTAIN):
            if not len(possible):
                break
            more = self.sampled(variates, possible)
            robots = more if robots is None else _SampledRobots.joined([robots, more])
            spread = self.chance_spread(possible)
            # All but the worst stay within a share of the room; the legs of all that take it are free.
            limits = self.belief.limits
            stay = robots.found & limits.within_travel(robots.deviations, share=UNCERTAIN_SHARE)
            stay &= limits.within_travel(robots.deviations, spread, predicted_records.TRAVEL_SHARE)
            are_free = (robots.leg_margins >= 0.0).all(axis=-1)
            within = np.asarray(
                (np.count_nonzero(~stay, axis=0) <= 1) & (are_free | ~robots.found).all(axis=0)
            )
            possible, robots = possible[within], robots[:, within]
        holds = np.zeros(len(self.joints) - 1, dtype=bool)
        holds[possible] = robots is not None and len(robots) >= FEWEST_SAMPLES
        return holds

    def sampled(self, variates: Array, targets: NDArray[np.intp]) -> _SampledRobots:
        """Robots sampled by normal ``variates`` (r, p), solved at the reference and some of the targets.

        Robots that cannot take the reference are dropped: the true robot could.
        """
        belief, mechanism = self.belief, self.belief.mechanism
        at = np.append(0, 1 + targets)
        errors = variates @ np.linalg.cholesky(belief.covariance).T
        # Each robot at each pose is one row: all poses of the first robot, then those of the next one.
        rows = np.tile(at, len(errors))
        vectors = belief.estimate.vector + errors @ mechanism.convention.basis.T
        geometries = GeometryBatch(mechanism.parameters, vectors.repeat(len(at), axis=0))
        # Newton's method starts where linear propagation puts the pose of each robot.
        steps = (errors @ self.sensitivity.free[at].reshape(-1, errors.shape[1]).T).reshape(-1, 6)
        solved = forward_kinematics(
            mechanism,
            geometries,
            self.joints[rows],
            apply_twist(self.poses[rows], steps),
            mode=self.sensitivity.mode[rows],
            tolerance_mm=TOLERANCE_MM,
        )
        everywhere = geometries, solved.poses, self.joints[rows]
        margin = belief.limits.singularity_margin
        found = solved.found & has_singularity_margin(mechanism, *everywhere, MARGIN_SHARE * margin)
        leg_margins = belief.limits.leg_margins(mechanism, *everywhere)
        # A robot next to a singularity at its reference is refused before anything moves, and one whose
        # joints are at their end there does not come to the reference.
        first = np.arange(0, len(rows), len(at))
        at_reference = geometries.subset(first), solved.poses[first], self.joints[rows[first]]
        kept = found[first] & has_singularity_margin(mechanism, *at_reference, margin)
        kept &= (leg_margins[first] >= 0.0).all(axis=-1)
        shape = len(errors), len(at)
        beside = belief.beside(self.poses[at], self.joints[at])
        positions = solved.poses.positions.reshape(*shape, 3)[kept] + beside
        return _SampledRobots(
            found=found.reshape(shape)[kept, 1:],
            deviations=positions[:, 1:] - positions[:, :1],
            leg_margins=leg_margins.reshape(*shape, -1)[kept, 1:],
        )


def _all_within(sampled: _SampledRobots, limits: Limits, stops: Array, share: float) -> Mask:
    """At which targets all sampled robots, and those that ``SIGMAS`` predict, stay within a share of it.

    ``stops`` (n, 3), mm, is the spread of their stops.
    """
    deviations, margins = sampled.deviations, sampled.leg_margins
    spread = (deviations @ limits.frames.base).std(axis=0)
    mean_deviation, both = deviations.mean(axis=0), np.hypot(SIGMAS * spread, stops)
    stopped = max(share, predicted_records.TRAVEL_SHARE)
    predicted = limits.within_travel(mean_deviation, SIGMAS * spread, share)
    predicted &= limits.within_travel(mean_deviation, both, stopped)
    stay = sampled.found & limits.within_travel(deviations, share=share)
    stay &= limits.within_travel(deviations, stops, stopped)
    mean = margins.mean(axis=0)
    are_free = (mean >= SPARE_SIGMAS * np.sqrt(np.mean((margins - mean) ** 2, axis=0))).all(axis=-1)
    return np.asarray(np.all(stay, axis=0) & predicted & are_free)


@lru_cache
def _standard_normal(samples: int, count: int) -> Array:
    """(samples, count) antithetic normal variates, the same ones every time: choices can be repeated."""
    half = np.random.default_rng(0).standard_normal((samples // 2, count))
    return np.concatenate([half, -half])
