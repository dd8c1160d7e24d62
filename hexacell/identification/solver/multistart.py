"""Other robots at which a search may begin, where the drawing led it astray.

With few records, and near a singularity at the drawing, the truth may lie beyond that singularity:
no way down the cost leads there. Robots are drawn from what the tolerances allow, and those that the
records contradict least are where a search has the best prospects.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

DRAWN = 240
MOST_PROMISING = 12


def start_points(problem: Problem) -> Iterator[tuple[Array, PoseBatch]]:
    """Free parameters (p,), mm, the most promising first, and the poses that close them."""
    root = np.linalg.cholesky(problem.prior.covariance)
    draws = np.random.default_rng(0).standard_normal((DRAWN, len(root)))
    costs = np.array([_cost(problem, problem.initial_parameters + root @ draw) for draw in draws])
    order = np.argsort(costs, kind="stable")[:MOST_PROMISING]
    for row in order[np.isfinite(costs[order])]:
        free = problem.initial_parameters + root @ draws[row]
        yield free, _poses(problem, free)[0]


def _cost(problem: Problem, free: Array) -> float:
    """The weighted squares of the residuals; infinite where a record cannot be taken or says nothing."""
    poses, found = _poses(problem, free)
    if not found:
        return np.inf
    prediction = predict(problem, free, poses)
    if prediction.amplification.max() > LARGEST_AMPLIFICATION:
        return np.inf
    return float(NuisanceElimination(problem, prediction.weights).cost(prediction.residuals))


def _poses(problem: Problem, free: Array) -> tuple[PoseBatch, bool]:
    followed = problem.commands.solve_poses(Geometry.from_vector(problem.basis @ free), problem.joints)
    return followed.poses, bool(followed.found.all())
