"""The pose worth measuring next: the most informative one that surely stays inside the travel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell import kinematics
from hexacell.design.candidates import Candidates, reachable
from hexacell.design.knowledge import Knowledge
from hexacell.errors import LimitError
from hexacell.identification.model import record_covariance, record_weights
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array

SAFETY_SIGMAS = 3.0
TRAVEL_SHARE = 0.9
"""Of the travel, for the predicted deviation and three sigma: the rest is for second-order terms."""


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
        reference_jacobian: its derivative by the free parameters (3, p).
        mean_jacobian: weighted mean (3, p) of those of the point's records.
        covariance: (3, 3), mm^2, of the point's constant, the parameters being known.
    """

    reference: Array
    reference_jacobian: Array
    mean_jacobian: Array
    covariance: Array


def station(knowledge: Knowledge, poses: Poses, joints: Array) -> Station:
    """The station of a point's records so far: poses under the estimate; the first row zeroed it."""
    jacobian, by_joints = _derivatives(knowledge, poses, joints)
    weights = record_weights(by_joints, knowledge.noise)
    covariance = np.linalg.inv(weights.sum(axis=0))
    mean = covariance @ np.einsum("nij,njp->ip", weights, jacobian)
    return Station(poses.positions[0], jacobian[0], mean, covariance)


def choose(knowledge: Knowledge, at: Station, orientations: Array) -> Choice:
    """The best of the orientations (n, 3, 3) about the zeroed reference.

    Raises:
        LimitError: none of them is reachable within the limits and surely inside the travel.
    """
    candidates = reachable(knowledge, Poses.at(at.reference, orientations))
    if not len(candidates):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    jacobian, by_joints = _derivatives(knowledge, candidates.targets, candidates.joints)
    deviation = candidates.targets.positions - at.reference
    noise = record_covariance(by_joints, knowledge.noise)
    sigma = _deviation_sigma(knowledge, jacobian - at.reference_jacobian, noise)
    outside = np.abs(deviation) + SAFETY_SIGMAS * sigma > TRAVEL_SHARE * knowledge.limits.gauge_travel_mm
    gain = _information(knowledge, jacobian - at.mean_jacobian, noise + at.covariance)
    gain[outside.any(axis=-1)] = -np.inf
    best = int(np.argmax(gain))
    if not np.isfinite(gain[best]):
        raise LimitError("no orientation surely keeps the ball inside the gauges' travel")
    return _choice(candidates, best, deviation[best], sigma[best], float(gain[best]))


def _choice(candidates: Candidates, row: int, deviation: Array, sigma: Array, gain: float) -> Choice:
    return Choice(candidates.commands.pose(row), candidates.joints[row], deviation, sigma, gain)


def _derivatives(knowledge: Knowledge, poses: Poses, joints: Array) -> tuple[Array, Array]:
    sensitivity = kinematics.sensitivity(knowledge.mechanism, knowledge.estimate, poses, joints)
    return sensitivity.parameters[:, :3] @ knowledge.basis, sensitivity.joints[:, :3]


def _deviation_sigma(knowledge: Knowledge, jacobian: Array, noise: Array) -> Array:
    spread = jacobian @ knowledge.covariance @ np.swapaxes(jacobian, -1, -2) + noise
    return np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))


def _information(knowledge: Knowledge, jacobian: Array, noise: Array) -> Array:
    """``log det(I + noise^-1 H C H^T) / 2`` (n,), nat."""
    signal = jacobian @ knowledge.covariance @ np.swapaxes(jacobian, -1, -2)
    return 0.5 * (np.linalg.slogdet(signal + noise)[1] - np.linalg.slogdet(noise)[1])
