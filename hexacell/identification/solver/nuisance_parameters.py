"""Nuisance parameters of the stations, eliminated exactly.

A record satisfies ``P - d = c + w x d - k * d + noise``, with the position c of the ball when the
point's gauges were zeroed, the small rotation w of the gauges against the base, and the scale errors
k of the gauges, which are along their axes. All of them are linear, so for given weights their best
values are computed and subtracted, and they never become parameters (variable projection; Golub and
Pereyra 1973): c and w for each point, with a prior on w, and k once for all points, with a prior as
well. With equal weights and without w and k this subtracts the mean of each point, which has the same
minimum as all the pairs of eq. 5-8 of Abtahi et al. 2010, with 2/(k-1) of the rows. The cost is linear
in the number of records.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.kinematics.rotations import Array, skew


@dataclass(frozen=True, slots=True, eq=False)
class ReducedSystem:
    """Whitened rows of the linear least-squares problem, those of the priors on w and k included.

    Attributes:
        rows: (r, p).
        values: (r,).
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


class NuisanceElimination:
    """The elimination for one set of weights (n, 3, 3), 1/mm^2."""

    def __init__(self, problem: Problem, weights: Array) -> None:
        self.problem = problem
        self._weights = weights
        self._turns = problem.noise.alignment > 0.0
        self._stations = problem.stations
        self._local = _local_design(problem)
        self._local_prior = np.full(self._local.shape[-1] - 3, problem.noise.alignment)
        self._normal = np.linalg.inv(self._local_normal())
        self._scale_rows: Array = np.zeros((0, 3))
        self._scale_design: Array = np.zeros((problem.records, 3, 0))
        self._has_scale = problem.noise.gauge_scale > 0.0
        if self._has_scale:
            shown = problem.deviations @ problem.gauges
            design = -problem.gauges * shown[:, None, :]
            self._scale_design, self._scale_rows = self._without_stations(design)
            normal = self._gram(self._scale_design, self._scale_rows)
            self._scale_normal = np.linalg.inv(normal + np.eye(3) / problem.noise.gauge_scale**2)

    def centred(self, values: Array) -> Array:
        """Values (n, 3, ...) less the best c, w and k."""
        return self._reduced(values)[0]

    def system(self, residuals: Array, jacobian: Array) -> ReducedSystem:
        """Residuals (n, 3) and their Jacobian (n, 3, p), centred and whitened."""
        both = np.concatenate([jacobian, residuals[..., None]], axis=-1)
        centred_values, penalties = self._reduced(both)
        factor = np.swapaxes(np.linalg.cholesky(self._weights), -1, -2)
        rows = np.concatenate([(factor @ centred_values).reshape(-1, both.shape[-1]), penalties])
        return ReducedSystem(rows[:, :-1], rows[:, -1])

    def cost(self, residuals: Array) -> float:
        """The weighted sum of squares of centred residuals (n, 3), priors included."""
        r, penalties = self._reduced(residuals)
        weighted = np.einsum("ni,nij,nj->", r, self._weights, r)
        return float(weighted + np.sum(penalties**2))

    def nuisance_covariance(self) -> Array:
        """Covariance (n, 3, 3), mm^2, of what is subtracted from each record."""
        spread = self._normal[self._stations]
        taken = self._local @ spread @ np.swapaxes(self._local, -1, -2)
        if self._has_scale:
            design = self._scale_design
            taken = taken + design @ self._scale_normal @ np.swapaxes(design, -1, -2)
        return taken

    def _local_normal(self) -> Array:
        if not self._turns:
            return self.problem.group_sums(self._weights)
        transposed = np.swapaxes(self._local, -1, -2)
        normal = self.problem.group_sums(transposed @ self._weights @ self._local)
        for axis, sigma in enumerate(self._local_prior, start=3):
            normal[:, axis, axis] += sigma**-2
        return normal

    def _reduced(self, values: Array) -> tuple[Array, Array]:
        """Centred values, and the rows (r, k) that the priors add to the sum of squares."""
        flat = values.reshape(*values.shape[:2], -1)
        reduced, penalties = self._without_stations(flat)
        if self._has_scale:
            scale = self._scale_normal @ self._gram(reduced, penalties)
            reduced = reduced - self._scale_design @ scale
            prior = scale / self.problem.noise.gauge_scale
            penalties = np.concatenate([penalties - self._scale_rows @ scale, prior])
        return reduced.reshape(values.shape), penalties

    def _without_stations(self, values: Array) -> tuple[Array, Array]:
        """Values (n, 3, k) less the best c and w of each point, and the rows of the prior on w."""
        if not self._turns:
            means = self._normal @ self.problem.group_sums(self._weights @ values)
            return values - means[self._stations], np.zeros((0, values.shape[-1]))
        transposed = np.swapaxes(self._local, -1, -2)
        best = self._normal @ self.problem.group_sums(transposed @ (self._weights @ values))
        reduced = values - self._local @ best[self._stations]
        turned = best[:, 3:] / self._local_prior[:, None]
        return reduced, turned.reshape(-1, values.shape[-1])

    def _gram(self, values: Array, penalties: Array) -> Array:
        """Weighted products (3, k) of the design of k with values that contain no c and w."""
        products: Array = np.einsum("nai,nab,nbj->ij", self._scale_design, self._weights, values)
        return products + self._scale_rows.T @ penalties


def _local_design(problem: Problem) -> Array:
    """Derivatives (n, 3, 3 or 6) of a record by c and, if the stations may be rotated, w."""
    constant = np.broadcast_to(np.eye(3), (problem.records, 3, 3))
    if problem.noise.alignment == 0.0:
        return constant
    return np.concatenate([constant, -skew(problem.deviations)], axis=-1)
