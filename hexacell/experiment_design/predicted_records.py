"""Poses to choose from at a point, and the records that they would give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.experiment_design.candidates import ReachableTargets
from hexacell.experiment_design.gauge_zero import GaugeZero, position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.measurement_model import record_covariance
from hexacell.kinematics.rotations import Array, Mask

SAFETY_SIGMAS = 4.0
TRAVEL_SHARE = 0.9
"""Of the travel, for the predicted deviation and four sigma. What tells most lies at this limit, so that
of 50,000 records thousands do; with three sigma one in some thousands left the travel."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedRecords:
    """Poses to choose from, and the records (n) they would give.

    Attributes:
        change: Jacobians (n, 3, p) of the deviations; ``noise`` their covariance (n, 3, 3), mm^2,
            the parameters being known.
        deviation: expected (n, 3), mm, and its ``sigma`` (n, 3), mm.
    """

    targets: ReachableTargets
    jacobian: Array
    covariance: Array
    deviation: Array
    sigma: Array

    def __len__(self) -> int:
        return len(self.targets)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> PredictedRecords:
        return PredictedRecords(
            self.targets[rows],
            self.jacobian[rows],
            self.covariance[rows],
            self.deviation[rows],
            self.sigma[rows],
        )

    def within(self, distance_mm: float) -> Mask:
        """Which deviations stay within a distance on every axis, with four sigma."""
        farthest = np.abs(self.deviation) + SAFETY_SIGMAS * self.sigma
        within: Mask = (farthest <= distance_mm).all(axis=-1)
        return within


def predict_records(belief: RobotBelief, at: GaugeZero, stands: ReachableTargets) -> PredictedRecords:
    """The records of some poses, by straight error propagation."""
    jacobian, by_joints = position_derivatives(belief, stands)
    noise = record_covariance(by_joints, belief.noise) + at.covariance
    change = jacobian - at.jacobian
    spread = change @ belief.covariance @ np.swapaxes(change, -1, -2) + noise
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    return PredictedRecords(stands, change, noise, stands.targets.positions - at.reference, sigma)
