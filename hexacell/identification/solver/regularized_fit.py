"""One fit of a problem: from the drawing, the prior released where the data speak.

The tolerance prior keeps the solver on the road from the drawing and holds what the data do not
determine. In a direction that the data determine much better than the drawing does, it would only
bias the result toward the drawing; there it is released, and the estimate is the data's alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import singular_records
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.levenberg_marquardt import (
    CAUTIOUS_DAMPING,
    COARSE,
    FINE,
    Solution,
    SolverOptions,
    solve,
)
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

RELEASE_RATIO = 9.0
"""Data information over prior information from which on the data speak alone (sigma a third)."""

LEAST_REDUNDANCY = 10
"""Equations beyond the unknowns from which on residuals tell the noise."""

SMALLEST_CHI2 = 1e-6


QUICK = SolverOptions(CAUTIOUS_DAMPING, 1e-3, iterations=60, searches=12)
"""Twice what records that agree with each other need; others are not worth more."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A solution, and what it was reached with.

    Attributes:
        problem: the records that took part in the end.
        active_prior: precision (p, p), 1/mm^2, of the prior as far as it took part.
        covariance: of the free parameters (p, p), mm^2.
    """

    problem: Problem
    solution: Solution
    active_prior: Array
    covariance: Array

    @property
    def goodness(self) -> ChiSquareTest:
        """The residuals against the stated noise."""
        taken = float(np.sum(self.covariance * self.solution.information))
        return ChiSquareTest(self.solution.chi2, 3.0 * (self.problem.records - self.problem.points) - taken)


def fit(problem: Problem, *, manner: SolverOptions = COARSE) -> Fit:
    """The geometry that explains the records, from where the problem says on."""
    return _released(problem, problem.initial_parameters, problem.start, manner)


def refit(problem: Problem, free: Array, poses: PoseBatch) -> Fit:
    """The same from free parameters (p,), mm, that are nearly right, and poses that close them."""
    return _released(problem, free, poses, FINE)


def _released(problem: Problem, free: Array, poses: PoseBatch, manner: SolverOptions) -> Fit:
    precision = np.linalg.inv(problem.prior.covariance)
    kept, cautious = singular_records.solve_around_singularities(
        problem, precision, free=free, poses=poses, manner=manner
    )
    information = _quieter_than_stated(kept, cautious) * cautious.information
    held = _precision_where_silent(information, problem.prior.covariance)
    solution = solve(kept, held, free=cautious.free, poses=cautious.prediction.poses, manner=FINE)
    return Fit(kept, solution, held, np.linalg.inv(solution.information + held))


def _quieter_than_stated(problem: Problem, solution: Solution) -> float:
    """How many times the stated information the records hold, their residuals being that small; at least 1.

    Without it, records with hardly any noise would be held by a prior that they outweigh by far.
    """
    redundancy = 3 * (problem.records - problem.points) - len(solution.free)
    if redundancy < LEAST_REDUNDANCY:
        return 1.0
    return max(1.0, redundancy / max(solution.chi2, SMALLEST_CHI2))


def _precision_where_silent(information: Array, prior_covariance: Array) -> Array:
    """The prior's precision in the directions that the data leave open, zero in the others."""
    factor = np.linalg.cholesky(prior_covariance)
    ratios, directions = np.linalg.eigh(factor.T @ information @ factor)
    silent = directions[:, ratios < RELEASE_RATIO]
    back = np.linalg.solve(factor.T, silent)
    return back @ back.T
