"""The information of whole sets of records, before any of their poses is selected.

The poses that will be selected at a point are represented by a set of well spread ones: the greedy
D-optimal set for the robot as drawn. The information that n records add is computed from their
Jacobians H and covariances V at the present estimate. The point's unknown zero is eliminated by the Schur
complement:

    I = sum H^T V^-1 H - (sum H^T V^-1) (sum V^-1)^-1 (sum V^-1 H).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.experiment_design import candidates
from hexacell.experiment_design.candidates import ReachableTargets, reachable
from hexacell.experiment_design.criteria import D_OPTIMAL
from hexacell.experiment_design.predicted_records import position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.measurement_model import record_covariance, record_weights
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

CANDIDATES = 64


@dataclass(frozen=True, eq=False)
class PlannedSets:
    """Sets of poses, one a point.

    Attributes:
        sets: in the mechanism's frame convention; the reference is the first of each.
    """

    sets: tuple[PoseBatch, ...]

    @classmethod
    def select(cls, drawn: RobotBelief, points: Array, records: int, seed: int) -> PlannedSets:
        """Sets of ``records`` poses at ball positions (m, 3), mm; empty where the robot cannot go."""
        rotated = candidates.orientations(CANDIDATES, drawn.limits.tilt, seed)
        orientations = np.concatenate([np.eye(3)[None], rotated])
        return cls(tuple(_select(drawn, PoseBatch.at(point, orientations), records) for point in points))

    def information_under(self, belief: RobotBelief) -> PlannedInformation:
        """The information of the sets at the present estimate; poses it cannot reach are left out."""
        poses = PoseBatch.concatenate(self.sets)
        joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
        rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
        jacobian, by_joints = position_derivatives(belief, ReachableTargets(poses[rows], joints[rows]))
        ends = np.cumsum([len(poses) for poses in self.sets])
        return PlannedInformation(
            jacobian, record_weights(by_joints, belief.noise), np.searchsorted(rows, [0, *ends])
        )


@dataclass(frozen=True, eq=False)
class PlannedInformation:
    """The records of some sets, linearized.

    Attributes:
        jacobian: of all sets' records (n, 3, p) by the free parameters.
        weights: inverse covariances of the records (n, 3, 3), 1/mm^2.
        bounds: (m + 1,) rows at which the sets begin, and the last one ends.
    """

    jacobian: Array
    weights: Array
    bounds: NDArray[np.intp]

    def information(self, point: int, records: int) -> Array:
        """The information (p, p), 1/mm^2, of the first ``records`` of a point, counted from 1."""
        first, last = self.bounds[point - 1], self.bounds[point]
        rows = slice(int(first), int(min(first + max(records, 0), last)))
        jacobian, weights = self.jacobian[rows], self.weights[rows]
        size = self.jacobian.shape[-1]
        if len(jacobian) < 2:
            return np.zeros((size, size))
        weighted = weights @ jacobian
        total = weighted.sum(axis=0)
        mean = np.linalg.solve(weights.sum(axis=0), total)
        information: Array = jacobian.reshape(-1, size).T @ weighted.reshape(-1, size) - total.T @ mean
        return information


def _select(drawn: RobotBelief, poses: PoseBatch, records: int) -> PoseBatch:
    """The first of the poses, then greedily those that gain most beside the ones selected."""
    targets = reachable(drawn, poses).targets
    if not len(targets) or not np.array_equal(targets.poses.rotations[0], poses.rotations[0]):
        return poses[[]]
    selected = [0]
    jacobian, by_joints = position_derivatives(drawn, targets)
    change = jacobian - jacobian[0]
    noise = record_covariance(by_joints, drawn.noise)
    noise = noise + noise[0]
    covariance = drawn.covariance
    for _ in range(min(records, len(targets)) - 1):
        gain = D_OPTIMAL.gain(covariance, change, noise)
        gain[selected] = -np.inf
        best = int(np.argmax(gain))
        selected.append(best)
        covariance = covariance_update(covariance, change[best], noise[best])
    return targets.poses[selected]


def covariance_update(covariance: Array, jacobian: Array, noise: Array) -> Array:
    """A covariance (p, p) after a record of Jacobian (3, p) and covariance (3, 3): the Kalman update."""
    crossing = covariance @ jacobian.T
    after: Array = covariance - crossing @ np.linalg.solve(jacobian @ crossing + noise, crossing.T)
    return 0.5 * (after + after.T)


def add_information(covariance: Array, information: Array) -> Array:
    """A covariance (p, p) after records that add ``information`` (p, p)."""
    after: Array = np.linalg.inv(np.linalg.inv(covariance) + information)
    return 0.5 * (after + after.T)
