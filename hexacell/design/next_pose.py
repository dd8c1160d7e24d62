"""The pose worth measuring next: the most informative one that surely stays inside the travel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell import kinematics
from hexacell.design.candidates import Candidates, reachable
from hexacell.design.knowledge import Knowledge
from hexacell.design.path import is_clear
from hexacell.errors import LimitError
from hexacell.identification.model import record_covariance, record_weights
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array

SAFETY_SIGMAS = 3.0
TRAVEL_SHARE = 0.9
"""Of the travel, for the predicted deviation and three sigma: the rest is for second-order terms."""


PATHS_TRIED = 64


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The pose chosen.

    Attributes:
        command: what to send to the controller as it is configured now.
        joints: joint variables (6,), mm, it will go to.
        deviation: what the gauges are expected to show (3,), mm, and ``sigma`` (3,), mm.
        gain: information gained on the parameters, nat.
    """

    command: Pose
    joints: Array
    deviation: Array
    sigma: Array
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """What is known of the zeroed gauges at a point.

    Attributes:
        reference: where the estimate says the ball was when they were zeroed (3,), mm.
        orientation: the platform's then (3, 3), under the estimate.
        jacobian: derivative (3, p) of ``reference`` by the free parameters.
        covariance: of ``reference`` (3, 3), mm^2, the parameters being known.
    """

    reference: Array
    orientation: Array
    jacobian: Array
    covariance: Array


def station(knowledge: Knowledge, poses: Poses, joints: Array, deviations: Array) -> Station:
    """The station of a point's records so far (n): their poses under the estimate, the first at zero."""
    jacobian, by_joints = _derivatives(knowledge, poses, joints)
    weights = record_weights(by_joints, knowledge.noise)
    covariance = np.linalg.inv(weights.sum(axis=0))
    reference = covariance @ np.einsum("nij,nj->i", weights, poses.positions - deviations)
    mean = covariance @ np.einsum("nij,njp->ip", weights, jacobian)
    return Station(reference, poses.rotations[0], mean, covariance)


def choose(knowledge: Knowledge, at: Station, turns: Array, present: Poses | None = None) -> Choice:
    """The best of some turns (n, 3, 3) away from the orientation at the zeroed reference.

    Turns start there and not at the untilted platform: with millimetres of error in the joints the
    platform may stand 20 degrees from where the controller believes it to be. From the ``present``
    pose, as last commanded, a straight line must lead there.

    Raises:
        LimitError: none of them is reachable within the limits and surely inside the travel.
    """
    candidates = reachable(knowledge, Poses.at(at.reference, turns @ at.orientation))
    if not len(candidates):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    jacobian, by_joints = _derivatives(knowledge, candidates.targets, candidates.joints)
    noise = record_covariance(by_joints, knowledge.noise) + at.covariance
    change = jacobian - at.jacobian
    spread = change @ knowledge.covariance @ np.swapaxes(change, -1, -2) + noise
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    deviation = candidates.targets.positions - at.reference
    outside = np.abs(deviation) + SAFETY_SIGMAS * sigma > TRAVEL_SHARE * knowledge.limits.gauge_travel_mm
    # Information on the parameters, nat: log det(1 + noise^-1 H C H^T) / 2.
    gain = 0.5 * (np.linalg.slogdet(spread)[1] - np.linalg.slogdet(noise)[1])
    gain[outside.any(axis=-1)] = -np.inf
    for best in np.argsort(-gain)[:PATHS_TRIED]:
        if not np.isfinite(gain[best]):
            break
        command = candidates.commands[[int(best)]]
        if present is None or is_clear(knowledge, present, command, at.reference):
            return _choice(candidates, int(best), deviation[best], sigma[best], float(gain[best]))
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def _choice(candidates: Candidates, row: int, deviation: Array, sigma: Array, gain: float) -> Choice:
    return Choice(candidates.commands.pose(row), candidates.joints[row], deviation, sigma, gain)


def _derivatives(knowledge: Knowledge, poses: Poses, joints: Array) -> tuple[Array, Array]:
    sensitivity = kinematics.sensitivity(knowledge.mechanism, knowledge.estimate, poses, joints)
    return sensitivity.parameters[:, :3] @ knowledge.basis, sensitivity.joints[:, :3]
