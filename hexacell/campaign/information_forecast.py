"""What whole sets of records would do to the estimate, before any of them is chosen.

At each point a set of well spread poses is kept ready: the most informative ones of the robot as
drawn, one after the other. What a set of n records tells follows from their Jacobians H and
covariances V at the present estimate, the point's unknown constant left out:

    I = sum H^T V^-1 H - (sum H^T V^-1) (sum V^-1)^-1 (sum V^-1 H).

Later choices adapt to what is found; these sets do not, and so they only foretell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.experiment_design import candidates
from hexacell.experiment_design.candidates import ReachableTargets, reachable
from hexacell.experiment_design.gauge_zero import position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.measurement_model import record_covariance, record_weights
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

CANDIDATES = 64


@dataclass(frozen=True, eq=False)
class PlannedSets:
    """Sets of poses, and what they would tell.

    Attributes:
        sets: at each point, in the mechanism's frame convention; the reference is the first.
    """

    sets: tuple[PoseBatch, ...]

    @classmethod
    def select(cls, drawn: RobotBelief, points: Array, records: int, seed: int) -> PlannedSets:
        """Sets of so many ``records`` at ball positions (m, 3), mm; empty where the robot cannot go."""
        turns = candidates.orientations(CANDIDATES, drawn.limits.tilt, seed)
        turns = np.concatenate([np.eye(3)[None], turns])
        return cls(tuple(_spread(drawn, PoseBatch.at(point, turns), records) for point in points))

    def information_under(self, belief: RobotBelief) -> PlannedInformation:
        """The sets as the present estimate sees them; what it cannot reach is left out."""
        poses = PoseBatch(
            np.concatenate([poses.positions for poses in self.sets]),
            np.concatenate([poses.rotations for poses in self.sets]),
        )
        joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
        rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
        jacobian, by_joints = position_derivatives(belief, ReachableTargets(poses[rows], joints[rows]))
        sizes = np.cumsum([len(poses) for poses in self.sets])
        return PlannedInformation(
            jacobian, record_weights(by_joints, belief.noise), np.searchsorted(rows, [0, *sizes])
        )


@dataclass(frozen=True, eq=False)
class PlannedInformation:
    """What the records of some sets would tell.

    Attributes:
        jacobian: of all sets' records (n, 3, p) by the free parameters, and ``weights`` (n, 3, 3).
        bounds: (m + 1,) row at which each point's begin.
    """

    jacobian: Array
    weights: Array
    bounds: NDArray[np.intp]

    def information(self, point: int, records: int) -> Array:
        """What the first ``records`` of a point (from 1) tell (p, p), 1/mm^2."""
        first, last = self.bounds[point - 1], self.bounds[point]
        rows = slice(int(first), int(min(first + max(records, 0), last)))
        jacobian, weights = self.jacobian[rows], self.weights[rows]
        size = self.jacobian.shape[-1]
        if len(jacobian) < 2:
            return np.zeros((size, size))
        weighted = weights @ jacobian
        total = weighted.sum(axis=0)
        mean = np.linalg.solve(weights.sum(axis=0), total)
        told: Array = jacobian.reshape(-1, size).T @ weighted.reshape(-1, size) - total.T @ mean
        return told


def _spread(drawn: RobotBelief, poses: PoseBatch, records: int) -> PoseBatch:
    """The first of the poses, then those that tell most, each beside what is taken already."""
    offered = reachable(drawn, poses)
    if not len(offered) or not np.array_equal(offered.targets.poses.rotations[0], poses.rotations[0]):
        return poses[[]]
    taken = [0]
    jacobian, by_joints = position_derivatives(drawn, offered.targets)
    change = jacobian - jacobian[0]
    noise = record_covariance(by_joints, drawn.noise)
    noise = noise + noise[0]
    covariance = drawn.covariance
    for _ in range(min(records, len(offered)) - 1):
        spread = change @ covariance @ np.swapaxes(change, -1, -2) + noise
        gain = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(noise)[1]
        gain[taken] = -np.inf
        best = int(np.argmax(gain))
        taken.append(best)
        covariance = covariance_update(covariance, change[best], noise[best])
    return offered.targets.poses[taken]


def covariance_update(covariance: Array, jacobian: Array, noise: Array) -> Array:
    """A covariance (p, p) after a record of Jacobian (3, p) and covariance (3, 3)."""
    crossing = covariance @ jacobian.T
    after: Array = covariance - crossing @ np.linalg.solve(jacobian @ crossing + noise, crossing.T)
    return 0.5 * (after + after.T)


def add_information(covariance: Array, information: Array) -> Array:
    """A covariance (p, p) after records that tell ``information`` (p, p)."""
    after: Array = np.linalg.inv(np.linalg.inv(covariance) + information)
    return 0.5 * (after + after.T)
