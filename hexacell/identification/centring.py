"""Each point's unknown constant, eliminated.

Where the ball was when the gauges were zeroed is one unknown position c a point. For given
weights W the best c is the weighted mean, so residuals and Jacobian are centred by it and c never
becomes a parameter: ``r_i - (sum W)^-1 sum W r``. With equal weights this has the same minimum as
all the pairs of eq. 5-8 of Abtahi et al. 2010, at 2/(k-1) of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem import Problem
from hexacell.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class CentredSystem:
    """Whitened rows of the linear least-squares problem.

    Attributes:
        rows: (3n, p).
        values: (3n,).
    """

    rows: Array
    values: Array

    def information(self) -> Array:
        """Fisher information of the data on the free parameters (p, p), 1/mm^2."""
        return self.rows.T @ self.rows

    def gradient(self) -> Array:
        """Half the gradient of the cost by the free parameters (p,)."""
        return self.rows.T @ self.values

    def cost(self) -> float:
        """Sum of squares: the chi-square of the residuals."""
        return float(self.values @ self.values)


def centred(problem: Problem, weights: Array, values: Array) -> Array:
    """Values (n, 3, ...) less their weighted mean at each point."""
    flat = values.reshape(*values.shape[:2], -1)
    sums = problem.group_sums(weights @ flat)
    means = np.linalg.solve(problem.group_sums(weights), sums)
    return (flat - problem.spread(means)).reshape(values.shape)


def system(problem: Problem, weights: Array, residuals: Array, jacobian: Array) -> CentredSystem:
    """The centred problem, whitened by the Cholesky factor of the weights."""
    factor = np.swapaxes(np.linalg.cholesky(weights), -1, -2)
    rows = factor @ centred(problem, weights, jacobian)
    values = factor @ centred(problem, weights, residuals)[..., None]
    return CentredSystem(rows.reshape(-1, jacobian.shape[-1]), values.reshape(-1))


def cost(problem: Problem, weights: Array, residuals: Array) -> float:
    """The weighted sum of squares of centred residuals."""
    r = centred(problem, weights, residuals)
    return float(np.einsum("ni,nij,nj->", r, weights, r))
