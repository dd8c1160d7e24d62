"""Random multistart: other start points for the solver if it finds a wrong minimum from the drawing.

With few records, and a pose near a singularity at the drawing, the true geometry may lie beyond that
singularity, where no descent from the drawing ends. Geometries are drawn from the tolerance prior,
and those of lowest cost are the start points.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

DRAWS = 240
START_POINTS = 12


def start_points(problem: Problem) -> Iterator[tuple[Array, PoseBatch]]:
    """Free parameters (p,), mm, that of lowest cost first, and the poses that close them."""
    root = np.linalg.cholesky(problem.prior.covariance)
    draws = np.random.default_rng(0).standard_normal((DRAWS, len(root)))
    costs = np.array([_cost(problem, problem.initial_parameters + root @ draw) for draw in draws])
    order = np.argsort(costs, kind="stable")[:START_POINTS]
    for row in order[np.isfinite(costs[order])]:
        free = problem.initial_parameters + root @ draws[row]
        yield free, _poses(problem, free)[0]


def _cost(problem: Problem, free: Array) -> float:
    """The chi-square of the residuals; infinite where a pose is not found or next to a singularity."""
    poses, found = _poses(problem, free)
    if not found:
        return np.inf
    prediction = predict(problem, free, poses)
    if prediction.amplification.max() > LARGEST_AMPLIFICATION:
        return np.inf
    return float(NuisanceElimination(problem, prediction.weights).cost(prediction.residuals))


def _poses(problem: Problem, free: Array) -> tuple[PoseBatch, bool]:
    result = problem.commands.solve_poses(problem.mechanism.convention.geometry(free), problem.joints)
    return result.poses, bool(result.found.all())
