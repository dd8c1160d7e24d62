"""The measurement model linearized around a geometry, for tests of its residuals.

:class:`LinearizedModel`: with residuals r, their Jacobian J and weights W, all with the stations'
unknowns eliminated, the estimate of further unknowns b that add ``Z b`` to the residuals needs only ``M r``
and blocks of ``M = W - W (A + J C J^T) W``, where A is what the stations and the gauges' scale absorb and C
the covariance of the parameters. At a minimum ``M r = W r``.

:class:`LinearCosts`: least costs of some of the records over the parameters p and the causes b of
systematic errors (:class:`.SystematicErrors`), which have unit variance:

    cost = (r + J dp + Z b)^T W (r + J dp + Z b) + b^T b + (p - p0)^T L (p - p0),

with the columns Z of the errors that records share. At the minimum over b the first two terms are the
weighted squares under the full covariance ``W^-1 + Z Z^T``.

Sources: Cook and Weisberg, Residuals and Influence in Regression, 1982 (added variables); Rasmussen and
Williams, Gaussian Processes for Machine Learning, 2006, section 2.7 (explicit basis functions).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.problem.prior import SystematicErrors
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction
from hexacell.kinematics.rotations import Array, Mask


@dataclass(frozen=True, slots=True, eq=False)
class LinearizedModel:
    """The linear model of n records at its own minimum.

    Attributes:
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
    def at_minimum(cls, problem: Problem, prediction: Prediction, covariance: Array) -> LinearizedModel:
        """Linearize at a minimum of the cost, where the parameters have the covariance (p, p), mm^2."""
        elimination = NuisanceElimination(problem, prediction.weights)
        return cls._of(elimination, prediction, covariance, np.zeros(len(covariance)))

    @classmethod
    def around(cls, problem: Problem, prediction: Prediction, active_prior: Array) -> LinearizedModel:
        """Linearize at any geometry, with the precision (p, p), 1/mm^2, of what is kept of the prior."""
        elimination = NuisanceElimination(problem, prediction.weights)
        system = elimination.system(prediction.residuals, prediction.jacobian)
        covariance = np.linalg.inv(system.information() + active_prior)
        gradient = system.gradient() + active_prior @ (prediction.free - problem.prior.free)
        return cls._of(elimination, prediction, covariance, -covariance @ gradient)

    @classmethod
    def _of(
        cls, elimination: NuisanceElimination, prediction: Prediction, covariance: Array, step: Array
    ) -> LinearizedModel:
        jacobian = elimination.centred(prediction.jacobian)
        by_parameters = jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
        return cls(
            problem=elimination.problem,
            weights=prediction.weights,
            residuals=elimination.centred(prediction.residuals) + jacobian @ step,
            jacobian=jacobian,
            covariance=covariance,
            explained=elimination.nuisance_covariance() + by_parameters,
        )

    @property
    def scores(self) -> Array:
        """``W r`` (n, 3), 1/mm."""
        return np.asarray(np.einsum("nij,nj->ni", self.weights, self.residuals))

    @property
    def residual_covariance(self) -> Array:
        """Covariance V (n, 3, 3), mm^2, of each residual; ``W V W`` is the record's block of M."""
        return np.asarray(np.linalg.inv(self.weights) - self.explained)

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the residuals."""
        return float(np.sum(self.scores * self.residuals))


@dataclass(frozen=True, slots=True, eq=False)
class LinearCosts:
    """The records of an identification at its solution.

    Attributes:
        weights: (n, 3, 3), 1/mm^2, under the errors that each record has of its own.
        common: (n, 3, k), mm, columns of the errors that records share.
        are_of_noise: whether no systematic errors are stated.
    """

    problem: Problem
    prediction: Prediction
    weights: Array
    common: Array
    are_of_noise: bool

    @classmethod
    def at(cls, problem: Problem, prediction: Prediction) -> LinearCosts:
        """Linearize at the ``prediction`` of all records of a problem."""
        errors = systematic_errors(problem, prediction)
        weights = prediction.weights
        is_of_noise = not errors.common.shape[-1] and not errors.own.any()
        if errors.own.any():
            weights = np.linalg.inv(np.linalg.inv(weights) + errors.own)
        return cls(problem, prediction, weights, errors.common, is_of_noise)

    def least(self, rows: Mask) -> float:
        """The least cost of some records (n,), the full prior included."""
        (system, values), (of_prior, from_centre) = self._system(rows), self._full_prior
        return _least_squares(np.vstack([system, of_prior]), np.concatenate([values, from_centre]))[1]

    def with_causes(self, columns: Array) -> LinearCosts:
        """These records with further errors (n, 3, k), mm, that they share, each of unit variance."""
        return replace(self, common=np.concatenate([self.common, columns], axis=-1), are_of_noise=False)

    def log_evidence(self, rows: Mask, scale: float = 1.0) -> float:
        """Logarithm of the density of some records (n,) under the full prior, but for a constant.

        Parameters and causes are integrated out. The constant is that of the records and their noise, whose
        variances are ``scale`` times as large as stated.
        """
        (system, values), (of_prior, from_centre) = self._system(rows), self._full_prior
        size = np.ones(len(system))
        size[: len(system) - self.common.shape[-1]] /= np.sqrt(scale)
        both = np.concatenate([size[:, None] * system, of_prior])
        every = np.concatenate([size * values, from_centre])
        normal, gradient = both.T @ both, both.T @ every
        cost = float(every @ every - gradient @ np.linalg.solve(normal, gradient))
        return -0.5 * (cost + float(np.linalg.slogdet(normal)[1]))

    def residual_test(self, active_prior: Array) -> ChiSquareTest:
        """The chi-square of all residuals, under a prior of precision (p, p), 1/mm^2."""
        system, values = self._system(np.ones(self.problem.records, dtype=bool))
        eigenvalues, vectors = np.linalg.eigh(active_prior)  # which may be singular
        factor = np.sqrt(np.maximum(eigenvalues, 0.0))[:, None] * vectors.T
        rows_of_prior, from_centre = self._prior(factor)
        both = np.concatenate([system, rows_of_prior])
        step, cost = _least_squares(both, np.concatenate([values, from_centre]))
        of_prior = from_centre + factor @ step[: len(self.prediction.free)]
        covariance = np.linalg.inv(both.T @ both)[: len(step) - self.common.shape[-1]]
        # Fisher information (p, p) of the rows on the parameters, whatever the causes are.
        by_parameters, by_causes = np.split(system, [len(self.prediction.free)], axis=1)
        shared = by_causes.T @ by_parameters
        information = by_parameters.T @ by_parameters
        information = information - shared.T @ np.linalg.solve(by_causes.T @ by_causes, shared)
        taken = float(np.sum(covariance[:, : len(covariance)] * information))
        chi2 = cost - float(of_prior @ of_prior)
        return ChiSquareTest(chi2, self.problem.coordinates - taken, self.problem.noise.freedom)

    def _system(self, rows: Mask) -> tuple[Array, Array]:
        """Whitened rows (r, p + k) and values (r,) of some records and of the causes' unit variance."""
        elimination = NuisanceElimination(self.problem.subset(rows), self.weights[rows])
        jacobian = np.concatenate([self.prediction.jacobian[rows], self.common[rows]], axis=-1)
        system = elimination.system(self.prediction.residuals[rows], jacobian)
        causes = self.common.shape[-1]
        unit = np.eye(jacobian.shape[-1])[jacobian.shape[-1] - causes :]
        return np.concatenate([system.rows, unit]), np.concatenate([system.values, np.zeros(causes)])

    @property
    def _full_prior(self) -> tuple[Array, Array]:
        return self._prior(np.linalg.cholesky(self.problem.prior.precision).T)

    def _prior(self, factor: Array) -> tuple[Array, Array]:
        """Rows and values of a prior by a factor of its precision; they do not depend on the causes."""
        rows = np.pad(factor, ((0, 0), (0, self.common.shape[-1])))
        return rows, factor @ (self.prediction.free - self.problem.prior.free)


def systematic_errors(problem: Problem, prediction: Prediction) -> SystematicErrors:
    """The errors of a problem's records at their predicted poses, beside the noise."""
    return problem.systematic(problem.measured_at(prediction.free, prediction.poses))


def _least_squares(system: Array, values: Array) -> tuple[Array, float]:
    """The step that makes ``values + system @ step`` least, and the sum of squares there."""
    step = -np.linalg.lstsq(system, values, rcond=None)[0]
    remaining = values + system @ step
    return step, float(remaining @ remaining)
