"""Poses to choose from at a point, and the records that they would give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.design.candidates import Standing
from hexacell.design.knowledge import Knowledge
from hexacell.design.station import Station, position_derivatives
from hexacell.identification.model import record_covariance
from hexacell.rotations import Array, Mask

SAFETY_SIGMAS = 4.0
TRAVEL_SHARE = 0.9
"""Of the travel, for the predicted deviation and four sigma. What tells most lies at this limit, so that
of 50,000 records thousands do; with three sigma one in some thousands left the travel."""


@dataclass(frozen=True, slots=True, eq=False)
class Offer:
    """Poses to choose from, and the records (n) they would give.

    Attributes:
        change: Jacobians (n, 3, p) of the deviations; ``noise`` their covariance (n, 3, 3), mm^2,
            the parameters being known.
        deviation: expected (n, 3), mm, and its ``sigma`` (n, 3), mm.
    """

    stands: Standing
    change: Array
    noise: Array
    deviation: Array
    sigma: Array

    def __len__(self) -> int:
        return len(self.stands)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> Offer:
        return Offer(
            self.stands[rows], self.change[rows], self.noise[rows], self.deviation[rows], self.sigma[rows]
        )

    def within(self, distance_mm: float) -> Mask:
        """Which deviations stay within a distance on every axis, with four sigma."""
        farthest = np.abs(self.deviation) + SAFETY_SIGMAS * self.sigma
        within: Mask = (farthest <= distance_mm).all(axis=-1)
        return within


def offer(knowledge: Knowledge, at: Station, stands: Standing) -> Offer:
    """The records of some poses, by straight error propagation."""
    jacobian, by_joints = position_derivatives(knowledge, stands)
    noise = record_covariance(by_joints, knowledge.noise) + at.covariance
    change = jacobian - at.jacobian
    spread = change @ knowledge.covariance @ np.swapaxes(change, -1, -2) + noise
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    return Offer(stands, change, noise, stands.targets.positions - at.reference, sigma)
