"""The measurement model linearized around a geometry, for tests of its residuals.

With residuals r, their Jacobian J and weights W, all with the stations' unknowns eliminated, the
estimate of further unknowns b that add ``Z b`` to the residuals needs only ``M r`` and blocks of

    M = W - W (A + J C J^T) W,

where A is what the stations and the gauges' scale absorb and C the covariance of the parameters.
At a minimum ``M r = W r``. Around any other geometry the residuals are those that remain after the
linear problem's own step.

Source: Cook and Weisberg, Residuals and Influence in Regression, 1982 (added variables).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import Prediction
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.identification.solver.result import Identification
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
        explained: (n, 3, 3), mm^2, ``A + J C J^T``, the covariance that the unknowns absorb.
    """

    problem: Problem
    weights: Array
    residuals: Array
    jacobian: Array
    covariance: Array
    explained: Array

    @classmethod
    def at_solution(cls, found: Identification) -> LinearizedModel:
        """Around an identification, where the linear problem's step is zero."""
        centring = NuisanceElimination(found.problem, found.prediction.weights)
        return cls._of(centring, found.prediction, found.free_covariance, np.zeros_like(found.free))

    @classmethod
    def around(cls, problem: Problem, prediction: Prediction, active_prior: Array) -> LinearizedModel:
        """Around any geometry; ``active_prior`` (p, p), 1/mm^2, is the precision of the prior used."""
        centring = NuisanceElimination(problem, prediction.weights)
        system = centring.system(prediction.residuals, prediction.jacobian)
        covariance = np.linalg.inv(system.information() + active_prior)
        gradient = system.gradient() + active_prior @ (prediction.free - problem.prior.free)
        return cls._of(centring, prediction, covariance, -covariance @ gradient)

    @classmethod
    def _of(
        cls, centring: NuisanceElimination, prediction: Prediction, covariance: Array, step: Array
    ) -> LinearizedModel:
        jacobian = centring.centred(prediction.jacobian)
        by_parameters = jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
        return cls(
            problem=centring.problem,
            weights=prediction.weights,
            residuals=centring.centred(prediction.residuals) + jacobian @ step,
            jacobian=jacobian,
            covariance=covariance,
            explained=centring.nuisance_covariance() + by_parameters,
        )

    @property
    def scores(self) -> Array:
        """``W r`` (n, 3), 1/mm."""
        scores: Array = np.einsum("nij,nj->ni", self.weights, self.residuals)
        return scores

    @property
    def residual_covariance(self) -> Array:
        """Covariance V (n, 3, 3), mm^2, of each residual; ``W V W`` is the record's block of M."""
        remaining: Array = np.linalg.inv(self.weights) - self.explained
        return remaining

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the residuals."""
        return float(np.sum(self.scores * self.residuals))
