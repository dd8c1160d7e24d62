"""A regularized fit: with the tolerance prior, which is released where the data determine the parameters.

The prior keeps the solver near the drawing and determines what the data do not. In a direction that
the data determine much better than the drawing does, it would only bias the result toward the
drawing. There it is released in a second solution, and the estimate depends on the data alone. The
directions are the eigenvectors of the data's information in coordinates in which the covariance of
the prior is the identity (as in truncated Tikhonov regularization; Hansen, Rank-Deficient and
Discrete Ill-Posed Problems, 1998).
"""

from __future__ import annotations

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import (
    COARSE,
    FINE,
    INITIAL_DAMPING,
    Solution,
    SolverOptions,
    solve,
)
from hexacell.identification.solver.result import Identification
from hexacell.identification.solver.singular_records import solve_around_singularities
from hexacell.kinematics.rotations import Array

RELEASE_RATIO = 9.0
"""Data information over prior information from which the prior is released (sigma: a third)."""

LEAST_REDUNDANCY = 10
"""Equations beyond the unknowns from which the residuals give an estimate of the noise."""

SMALLEST_CHI2 = 1e-6

QUICK = SolverOptions(INITIAL_DAMPING, 1e-3, iterations=60, searches=12)
"""Twice the iterations that consistent records need."""


def fit_regularized(problem: Problem, options: SolverOptions = COARSE) -> Identification:
    """Fit the records, from the initial parameters of the problem."""
    kept, regularized = solve_around_singularities(problem, problem.prior.precision, options)
    information = _noise_correction(kept, regularized) * regularized.information
    active_prior = _unreleased_precision(information, problem.prior.covariance)
    solution = solve(
        kept, active_prior, free=regularized.free, poses=regularized.prediction.poses, options=FINE
    )
    return Identification(kept, solution, active_prior)


def _noise_correction(problem: Problem, solution: Solution) -> float:
    """The factor of the stated information that residuals below the stated noise justify; at least 1.

    Without it, a prior would bias records with hardly any noise, which have far more information.
    """
    redundancy = problem.coordinates - len(solution.free)
    if redundancy < LEAST_REDUNDANCY:
        return 1.0
    return max(1.0, redundancy / max(solution.chi2, SMALLEST_CHI2))


def _unreleased_precision(information: Array, prior_covariance: Array) -> Array:
    """The prior's precision in the directions that the data do not determine, zero in the others."""
    factor = np.linalg.cholesky(prior_covariance)
    ratios, directions = np.linalg.eigh(factor.T @ information @ factor)
    undetermined = directions[:, ratios < RELEASE_RATIO]
    back = np.linalg.solve(factor.T, undetermined)
    return back @ back.T
