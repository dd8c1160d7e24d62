"""Random multistart: other start points for the solver if it finds a wrong minimum from the drawing.

With few records, and a pose near a singularity at the drawing, the true geometry may lie beyond that
singularity, where no descent from the drawing ends. Geometries are drawn from the tolerance prior,
and those of lowest cost are the start points.

Source: Rinnooy Kan and Timmer, Stochastic global optimization methods, Mathematical Programming 39, 1987.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.kinematics.rotations import Array

DRAWS = 240
START_POINTS = 12


def restarts(problem: Problem) -> Iterator[Problem]:
    """The problem with other start points, that of lowest cost first."""
    root = np.linalg.cholesky(problem.prior.covariance)
    draws = np.random.default_rng(0).standard_normal((DRAWS, len(root)))
    costs = np.array([_cost(problem, problem.initial_parameters + root @ draw) for draw in draws])
    order = np.argsort(costs, kind="stable")[:START_POINTS]
    for row in order[np.isfinite(costs[order])]:
        free = problem.initial_parameters + root @ draws[row]
        yield problem.starting_at(free, problem.solve_poses(free).poses)


def _cost(problem: Problem, free: Array) -> float:
    """The chi-square of the residuals; infinite where a pose is not found or next to a singularity."""
    solved = problem.solve_poses(free)
    if not solved.found.all():
        return np.inf
    prediction = predict(problem, free, solved.poses)
    if prediction.singular.any():
        return np.inf
    return NuisanceElimination(problem, prediction.weights).cost(prediction.residuals)
