"""The residuals to first order, and the test of one more unknown in them.

With residuals r, their Jacobian J and weights W, all centred, an unknown b that adds ``Z b`` to the
residuals is estimated, next to the parameters, by

    b = (Z^T M Z)^-1 Z^T M r,    M = W - W (A + J C J^T) W,

A what the stations and the gauges' scale absorb, C the parameters' covariance. Estimating it lowers
the chi-square by ``r^T M Z b``; a b that is known beforehand lowers it by less. For a test
neither a second solution nor the whole of M is needed: ``M r = W r`` where r is already the least
there is, and of M only the blocks of the records concerned.

Source: added-variable (score) tests of linear models; Cook and Weisberg, Residuals and Influence
in Regression, 1982, chapter 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.centring import Centring
from hexacell.identification.fit import Fit
from hexacell.identification.model import Prediction
from hexacell.identification.problem import Problem
from hexacell.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Expansion:
    """The linear model of some records, at its own solution.

    Attributes:
        problem: the records.
        weights: (n, 3, 3), 1/mm^2.
        residuals: (n, 3), mm, centred: predicted position less measured deviation.
        jacobian: (n, 3, p), centred.
        covariance: of the free parameters (p, p), mm^2.
        absorbed: (n, 3, 3), mm^2, the covariance of what centring takes from each record.
    """

    problem: Problem
    weights: Array
    residuals: Array
    jacobian: Array
    covariance: Array
    absorbed: Array

    @classmethod
    def at_solution(cls, fit: Fit) -> Expansion:
        """Around a fit, where no step is left to be made."""
        return cls._of(fit.problem, fit.solution.prediction, fit.covariance)

    @classmethod
    def around(cls, problem: Problem, prediction: Prediction, held: Array) -> Expansion:
        """Around any geometry: what its linear problem leaves; ``held`` is the prior's precision."""
        system = Centring(problem, prediction.weights).system(prediction.residuals, prediction.jacobian)
        covariance = np.linalg.inv(system.information() + held)
        from_centre = prediction.free - problem.mechanism.convention.free_part(problem.prior.centre)
        step = -covariance @ (system.gradient() + held @ from_centre)
        return cls._of(problem, prediction, covariance, step)

    @classmethod
    def _of(
        cls, problem: Problem, prediction: Prediction, covariance: Array, step: Array | None = None
    ) -> Expansion:
        centring = Centring(problem, prediction.weights)
        residuals, jacobian = centring.centred(prediction.residuals), centring.centred(prediction.jacobian)
        if step is not None:
            residuals = residuals + jacobian @ step
        return cls(problem, prediction.weights, residuals, jacobian, covariance, centring.absorbed())

    @property
    def scores(self) -> Array:
        """``W r`` (n, 3), 1/mm."""
        scores: Array = np.einsum("nij,nj->ni", self.weights, self.residuals)
        return scores

    @property
    def left(self) -> Array:
        """Covariance (n, 3, 3), mm^2, of each residual, and ``W left W`` is each record's block of M."""
        taken = self.jacobian @ self.covariance @ np.swapaxes(self.jacobian, -1, -2)
        remaining: Array = np.linalg.inv(self.weights) - self.absorbed - taken
        return remaining

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the residuals."""
        return float(np.sum(self.scores * self.residuals))
