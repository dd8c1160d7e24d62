"""What a measurement is worth: three criteria of optimal design.

A record with Jacobian H against its point's reference and own covariance V changes the parameters'
covariance C to ``C - C H^T (H C H^T + V)^-1 H C`` before it is measured. What counts is

- D, the volume of C: ``log det``;
- A, the sum of the variances of all parameters: ``tr C``;
- I, the mean variance of the position at the task poses: ``tr(J C J^T)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hexacell.kinematics.rotations import Array


class CriterionName(StrEnum):
    """What the orientations are chosen for."""

    INFORMATION = "information"
    PARAMETERS = "parameters"
    TASK = "task"


@dataclass(frozen=True, slots=True, eq=False)
class Criterion:
    """A criterion that can be evaluated.

    Attributes:
        weight: (p, p), 1: what the variances of the free parameters count; none for D.
    """

    weight: Array | None = None

    def gain(self, covariance: Array, change: Array, noise: Array) -> Array:
        """How much each of n records would be worth (n,): nat for D, mm^2 for A and I.

        ``covariance`` (p, p) and the records' own ``noise`` (n, 3, 3) in mm^2, ``change`` (n, 3, p)
        their Jacobians.
        """
        spread_by_parameter = change @ covariance
        spread = spread_by_parameter @ np.swapaxes(change, -1, -2) + noise
        if self.weight is None:
            return np.asarray(0.5 * (np.linalg.slogdet(spread)[1] - np.linalg.slogdet(noise)[1]))
        lost = np.linalg.solve(np.linalg.cholesky(spread), spread_by_parameter)
        gain: Array = np.einsum("nij,jk,nik->n", lost, self.weight, lost, optimize=True)
        return gain


D_OPTIMAL = Criterion()
