"""Least costs of some of the records of an identification, linearized at its solution.

Unknown are the free parameters p, the stations' and the gauges' constants, and the causes b of systematic
errors (:mod:`~hexacell.identification.problem.systematic_errors`), which have unit variance:

    cost = (r + J dp + Z b)^T W (r + J dp + Z b) + b^T b + (p - p0)^T L (p - p0),

with the columns Z of the errors that records share, W the inverse of the records' covariance with the
errors of each of its own, and L the precision of the prior. At the minimum over b the first two terms are
the weighted squares under the full covariance ``W^-1 + Z Z^T``, so that nothing more need be estimated.

Sources: Aitken 1936; Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.7
(explicit basis functions).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.problem.systematic_errors import MeasuredPoses, SystematicErrors
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.measurement_model import Prediction
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.kinematics.rotations import Array, Mask


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
        """At the ``prediction`` of all records."""
        errors = systematic_errors(problem, prediction)
        weights = prediction.weights
        if errors.own.any():
            weights = np.linalg.inv(np.linalg.inv(weights) + errors.own)
        return cls(problem, prediction, weights, errors.common, errors.are_none)

    def least(self, rows: Mask) -> float:
        """The least cost of some records (n,), the full prior included."""
        prior = self.problem.prior
        system, values = self._system(rows)
        factor = np.linalg.cholesky(prior.precision).T
        both = np.concatenate([system, self._only_parameters(factor)])
        return _least_squares(both, np.concatenate([values, factor @ self._from(prior.free)]))[1]

    def residual_test(self, active_prior: Array) -> ChiSquareTest:
        """The chi-square of all residuals, under a prior of precision (p, p), 1/mm^2."""
        system, values = self._system(np.ones(self.problem.records, dtype=bool))
        factor = _square_root(active_prior)
        both = np.concatenate([system, self._only_parameters(factor)])
        prior = factor @ self._from(self.problem.prior.free)
        step, cost = _least_squares(both, np.concatenate([values, prior]))
        of_prior = prior + factor @ step[: len(self.prediction.free)]
        covariance = np.linalg.inv(both.T @ both)[: len(step) - self.common.shape[-1]]
        taken = float(np.sum(covariance[:, : len(covariance)] * self._information(system)))
        return ChiSquareTest(cost - float(of_prior @ of_prior), self.problem.coordinates - taken)

    def _system(self, rows: Mask) -> tuple[Array, Array]:
        """Whitened rows (r, p + k) and values (r,) of some records and of the causes' unit variance."""
        elimination = NuisanceElimination(self.problem.subset(rows), self.weights[rows])
        jacobian = np.concatenate([self.prediction.jacobian[rows], self.common[rows]], axis=-1)
        system = elimination.system(self.prediction.residuals[rows], jacobian)
        causes = self.common.shape[-1]
        unit = np.eye(jacobian.shape[-1])[jacobian.shape[-1] - causes :]
        return np.concatenate([system.rows, unit]), np.concatenate([system.values, np.zeros(causes)])

    def _information(self, system: Array) -> Array:
        """Fisher information (p, p) of the rows on the parameters, whatever the causes are."""
        by_parameters, by_causes = np.split(system, [len(self.prediction.free)], axis=1)
        shared = by_causes.T @ by_parameters
        information: Array = by_parameters.T @ by_parameters
        return information - shared.T @ np.linalg.solve(by_causes.T @ by_causes, shared)

    def _only_parameters(self, factor: Array) -> Array:
        """Rows that do not depend on the causes."""
        return np.pad(factor, ((0, 0), (0, self.common.shape[-1])))

    def _from(self, free: Array) -> Array:
        return self.prediction.free - free


def systematic_errors(problem: Problem, prediction: Prediction) -> SystematicErrors:
    """The errors of a problem's records at their predicted poses, beside the noise."""
    return problem.systematic(
        MeasuredPoses(
            problem.mechanism,
            problem.geometry(prediction.free),
            prediction.poses,
            problem.joints,
            problem.deviations,
            problem.gauges,
        )
    )


def _least_squares(system: Array, values: Array) -> tuple[Array, float]:
    """The step that makes ``values + system @ step`` least, and the sum of squares there."""
    step = -np.linalg.lstsq(system, values, rcond=None)[0]
    remaining = values + system @ step
    return step, float(remaining @ remaining)


def _square_root(precision: Array) -> Array:
    """A matrix (p, p) F with ``F^T F`` the precision, which may be singular."""
    values, vectors = np.linalg.eigh(precision)
    root: Array = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root
