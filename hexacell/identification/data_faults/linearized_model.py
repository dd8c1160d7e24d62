"""The linear model of some records, which the score tests of data faults start from.

With residuals r, their Jacobian J and weights W, all with the stations' unknowns eliminated, the
estimate of further unknowns b that add ``Z b`` to the residuals needs only ``M r`` and blocks of

    M = W - W (A + J C J^T) W,

where A is what the stations and the gauges' scale absorb and C the covariance of the parameters.
At a minimum ``M r = W r``. Around any other geometry the residuals are those that remain after the
linear problem's own step.

Source: Cook and Weisberg, Residuals and Influence in Regression, 1982, chapter 2 (added variables).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import Prediction
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.identification.solver.regularized_fit import Fit
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class LinearizedModel:
    """The linear model of n records at its own minimum.

    Attributes:
        problem: the records.
        weights: (n, 3, 3), 1/mm^2.
        residuals: (n, 3), mm, centred: predicted position less measured deviation.
        jacobian: (n, 3, p), centred.
        covariance: of the free parameters (p, p), mm^2.
        nuisance_covariance: (n, 3, 3), mm^2, the covariance of what centring takes from each record.
    """

    problem: Problem
    weights: Array
    residuals: Array
    jacobian: Array
    covariance: Array
    nuisance_covariance: Array

    @classmethod
    def at_solution(cls, fit: Fit) -> LinearizedModel:
        """Around a fit, where the linear problem's step is zero."""
        return cls._of(fit.problem, fit.solution.prediction, fit.covariance)

    @classmethod
    def around(cls, problem: Problem, prediction: Prediction, active_prior: Array) -> LinearizedModel:
        """Around any geometry; ``active_prior`` (p, p), 1/mm^2, is the precision of the prior used."""
        system = NuisanceElimination(problem, prediction.weights).system(
            prediction.residuals, prediction.jacobian
        )
        covariance = np.linalg.inv(system.information() + active_prior)
        from_centre = prediction.free - problem.mechanism.convention.free_parameters(problem.prior.centre)
        step = -covariance @ (system.gradient() + active_prior @ from_centre)
        return cls._of(problem, prediction, covariance, step)

    @classmethod
    def _of(
        cls, problem: Problem, prediction: Prediction, covariance: Array, step: Array | None = None
    ) -> LinearizedModel:
        centring = NuisanceElimination(problem, prediction.weights)
        residuals, jacobian = centring.centred(prediction.residuals), centring.centred(prediction.jacobian)
        if step is not None:
            residuals = residuals + jacobian @ step
        return cls(
            problem, prediction.weights, residuals, jacobian, covariance, centring.nuisance_covariance()
        )

    @property
    def scores(self) -> Array:
        """``W r`` (n, 3), 1/mm."""
        scores: Array = np.einsum("nij,nj->ni", self.weights, self.residuals)
        return scores

    @property
    def residual_covariance(self) -> Array:
        """Covariance V (n, 3, 3), mm^2, of each residual; ``W V W`` is the record's block of M."""
        taken = self.jacobian @ self.covariance @ np.swapaxes(self.jacobian, -1, -2)
        remaining: Array = np.linalg.inv(self.weights) - self.nuisance_covariance - taken
        return remaining

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the residuals."""
        return float(np.sum(self.scores * self.residuals))
