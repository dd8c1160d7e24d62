"""Predicted records: the zero of a point's gauges, and what candidate poses would show against it.

Both are propagated linearly with their covariances.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.design.candidates import ReachableTargets, commands_for
from hexacell.design.criteria import innovation_covariance
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.placement import Placement
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.forward import modes_of
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import POSITION, free_sensitivity, sensitivity_and_margin
from hexacell.limits.limits import Limits

SAFETY_SIGMAS = 4.0
CHANCE_SIGMAS = 2.5
"""Standard deviations of what a stop shows by chance for which travel is kept. Where the ball leaves it
all the same, another pose is taken: it stops elsewhere each time, so that this is no lasting loss. Where
it stood when the gauges were zeroed is known better with each record."""
TRAVEL_SHARE = 0.9
"""Share of the travel that the predicted deviation and four sigma may use. The most informative poses are
at this limit, thousands of 50,000 records; with three sigma one in some thousands left the travel."""


@dataclass(frozen=True, eq=False)
class GaugeZero:
    """What is known of the zero of a point's gauges.

    Attributes:
        reference: estimated position (3,), mm, of the ball when they were zeroed.
        orientation: the platform's then (3, 3), under the estimate.
        joints: joint variables then (6,), mm.
        jacobian: derivative (3, p + 6 m) of ``reference`` by the free parameters and the coefficients of
            m terms.
        covariance: of ``reference`` (3, 3), mm^2, these being known.
        before: joint variables (6,), mm, where the robot is before the next pose.
    """

    reference: Array
    orientation: Array
    joints: Array
    jacobian: Array
    covariance: Array
    before: Array

    @cached_property
    def target(self) -> ReachableTargets:
        """The reference as a target (1)."""
        return ReachableTargets(PoseBatch.at(self.reference, self.orientation[None]), self.joints[None])

    def directions_to(self, targets: ReachableTargets) -> Array:
        """The directions (n, 6) from which joints arrive at n targets from where the robot is."""
        return np.sign(targets.joints - self.before)

    def command(self, belief: RobotBelief) -> PoseBatch:
        """The command (1) of the reference."""
        return commands_for(belief, self.target)[0]

    def mode(self, belief: RobotBelief) -> Array:
        """The assembly mode (1,) of the estimated robot at the reference."""
        return modes_of(belief.mechanism, belief.estimate, self.target.poses, self.target.joints)


def estimate_gauge_zero(
    belief: RobotBelief, poses: PoseBatch, joints: Array, deviations: Array, directions: Array | None = None
) -> GaugeZero:
    """The weighted mean of the zeros by each of a point's records (n).

    The first of their ``poses``, under the estimate, is the reference. ``directions`` (n, 6) are those from
    which the joints arrived; None: not known.

    Raises:
        LimitError: all poses are at a singularity, where the records have no information.
    """
    jacobian, by_joints = position_derivatives(belief, ReachableTargets(poses, joints), directions)
    weights = belief.noise.record_weights(by_joints)
    try:
        covariance = np.linalg.inv(weights.sum(axis=0))
    except np.linalg.LinAlgError:
        raise LimitError("the records of this point do not determine the ball's position") from None
    zeros = poses.positions + belief.beside(poses, joints) - deviations
    reference = covariance @ np.einsum("nij,nj->i", weights, zeros)
    mean_jacobian = covariance @ np.einsum("nij,njp->ip", weights, jacobian)
    return GaugeZero(reference, poses.rotations[0], joints[0], mean_jacobian, covariance, joints[-1])


def gauge_zero_at(belief: RobotBelief, found: Identification, point: int) -> GaugeZero:
    """The zero of a point's gauges by the records of an identification."""
    problem = found.problem
    rows = np.flatnonzero(problem.labels[:, 0] == point)
    shown = problem.joints[rows], problem.deviations[rows], problem.directions[rows]
    return estimate_gauge_zero(belief, found.poses[rows], *shown)


def position_derivatives(
    belief: RobotBelief, targets: ReachableTargets, directions: Array | None = None
) -> tuple[Array, Array]:
    """Derivatives of the ball's position at n targets where the joints arrive from ``directions`` (n, 6).

    (n, 3, p + 6 m) by the free parameters and the coefficients of m terms, and (n, 3, 6) by the joints.
    """
    at = belief.mechanism, belief.estimate, targets.poses, targets.joints
    sensitivity = free_sensitivity(*at, POSITION)
    return with_terms(belief, sensitivity.free, targets, directions), sensitivity.joints


def with_terms(
    belief: RobotBelief, free: Array, targets: ReachableTargets, directions: Array | None
) -> Array:
    """Derivatives (n, 3, p) by the free parameters, with those by the coefficients of terms after them."""
    if belief.terms is None:
        return free
    at = Placement(belief.mechanism, belief.estimate, targets.poses, targets.joints)
    arrived = np.zeros_like(targets.joints) if directions is None else directions
    columns = (term.pose_errors(at, arrived)[:, :3] for term in belief.terms.terms)
    return np.concatenate([free, *columns], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class PredictedRecords(Batch):
    """The records (n) that some targets would give.

    Attributes:
        targets: the poses.
        jacobian: of the deviations (n, 3, p + 6 m) by the free parameters and the coefficients of m terms.
        covariance: of the deviations (n, 3, 3), mm^2, these being known.
        deviation: expected deviations (n, 3), mm.
        sigma: standard deviations (n, 3), mm, of what the gauges x, y, z will show, as the parameters are
            known now, if the robot repeats and readings are exact.
        chance: (n, 3), mm, by where the joints stop and by noise, here and when the gauges were zeroed.
    """

    targets: ReachableTargets
    jacobian: Array
    covariance: Array
    deviation: Array
    sigma: Array
    chance: Array

    def within(self, limits: Limits, share: float = TRAVEL_SHARE) -> Mask:
        """Which deviations stay within a share of the gauges' room, with four sigma, by linear propagation.

        As far as chance goes they are almost surely inside as well.
        """
        spread = SAFETY_SIGMAS * self.sigma
        stopped = np.hypot(spread, CHANCE_SIGMAS * self.chance)
        is_within = limits.within_travel(self.deviation, spread, share)
        return is_within & limits.within_travel(self.deviation, stopped, TRAVEL_SHARE)


def predict_records(
    belief: RobotBelief, zero: GaugeZero, targets: ReachableTargets, directions: Array | None = None
) -> PredictedRecords:
    """The records of n targets at a point whose gauges were zeroed at ``zero``.

    Joints arrive from ``directions`` (n, 6); None: straight from where the robot is.
    """
    directions = zero.directions_to(targets) if directions is None else directions
    derivatives = position_derivatives(belief, targets, directions)
    return _predicted(belief, zero, targets, *derivatives)


def predict_clear_records(
    belief: RobotBelief, zero: GaugeZero, targets: ReachableTargets, mode: Array
) -> tuple[PredictedRecords, Mask]:
    """The records, and at which targets (n,) the robot has its singularity margin on an assembly ``mode``.

    At the others the records mean nothing.
    """
    at = belief.mechanism, belief.estimate, targets.poses, targets.joints
    sensitivity, clear = sensitivity_and_margin(*at, POSITION, belief.limits.singularity_margin)
    by_all = with_terms(belief, sensitivity.free, targets, zero.directions_to(targets))
    records = _predicted(belief, zero, targets, by_all, sensitivity.joints)
    return records, clear & (sensitivity.mode == mode)


def _predicted(
    belief: RobotBelief, zero: GaugeZero, targets: ReachableTargets, by_all: Array, by_joints: Array
) -> PredictedRecords:
    """The records by the derivatives of the ball's position, see :func:`position_derivatives`."""
    jacobian = by_all - zero.jacobian
    covariance = belief.noise.record_covariance(by_joints) + zero.covariance
    as_known = innovation_covariance(belief.joint_covariance, jacobian, np.zeros((3, 3)))
    sigma = belief.limits.sigma_along_gauges(as_known)
    by_chance = belief.noise.chance_covariance(by_joints) + zero.covariance
    chance = belief.limits.sigma_along_gauges(by_chance)
    deviation = targets.poses.positions + belief.beside(targets.poses, targets.joints) - zero.reference
    return PredictedRecords(targets, jacobian, covariance, deviation, sigma, chance)
