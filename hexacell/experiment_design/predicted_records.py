"""Records that candidate poses would give, predicted by linear propagation of covariance."""

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
"""Share of the travel that the predicted deviation and four sigma may use. The most informative poses are
at this limit, thousands of 50,000 records; with three sigma one in some thousands left the travel."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedRecords:
    """The records (n) that some targets would give.

    Attributes:
        targets: the poses.
        jacobian: of the deviations (n, 3, p) by the free parameters.
        covariance: of the deviations (n, 3, 3), mm^2, the parameters being known.
        deviation: expected deviations (n, 3), mm.
        sigma: their standard deviations (n, 3), mm, as the parameters are known now.
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


def predict_records(belief: RobotBelief, zero: GaugeZero, targets: ReachableTargets) -> PredictedRecords:
    """The records of some targets at a point whose gauges were zeroed at ``zero``."""
    by_parameters, by_joints = position_derivatives(belief, targets)
    covariance = record_covariance(by_joints, belief.noise) + zero.covariance
    jacobian = by_parameters - zero.jacobian
    total = jacobian @ belief.covariance @ np.swapaxes(jacobian, -1, -2) + covariance
    sigma = np.sqrt(np.diagonal(total, axis1=-2, axis2=-1))
    deviation = targets.poses.positions - zero.reference
    return PredictedRecords(targets, jacobian, covariance, deviation, sigma)
