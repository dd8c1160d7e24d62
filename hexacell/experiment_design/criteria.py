"""Criteria of optimal experiment design: what a record would be worth.

A record with Jacobian H against its point's reference and covariance V changes the covariance C of the
parameters to ``C - C H^T (H C H^T + V)^-1 H C``, which is known before it is measured. Records are
chosen one at a time, each the best beside those taken (Fedorov, Theory of Optimal Experiments, 1972;
Atkinson & Donev, Optimum Experimental Designs, 1992), for one of the criteria

- D: the volume of the confidence ellipsoid, ``log det C``;
- A: the sum of the variances of all parameters, ``tr C``;
- I: the mean variance of the position at the task poses, ``tr(J C J^T)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hexacell.kinematics.rotations import Array


class CriterionName(StrEnum):
    """What poses are chosen for: D, A or I, as the cell file names them."""

    INFORMATION = "information"
    PARAMETERS = "parameters"
    TASK = "task"


@dataclass(frozen=True, slots=True, eq=False)
class Criterion:
    """An optimality criterion.

    Attributes:
        weight: of the free parameters' covariance (p, p), dimensionless; none for D.
    """

    weight: Array | None = None

    def gain(self, covariance: Array, jacobian: Array, noise: Array) -> Array:
        """What each of n records would gain (n,): nat for D, mm^2 for A and I.

        Args:
            covariance: of the free parameters (p, p), mm^2.
            jacobian: of the records (n, 3, p).
            noise: covariance of the records themselves (n, 3, 3), mm^2.
        """
        crossing = jacobian @ covariance
        total = crossing @ np.swapaxes(jacobian, -1, -2) + noise
        if self.weight is None:
            return np.asarray(0.5 * (np.linalg.slogdet(total)[1] - np.linalg.slogdet(noise)[1]))
        factor = np.linalg.solve(np.linalg.cholesky(total), crossing)
        gain: Array = np.einsum("nij,jk,nik->n", factor, self.weight, factor, optimize=True)
        return gain


D_OPTIMAL = Criterion()
