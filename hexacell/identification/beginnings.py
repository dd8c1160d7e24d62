"""Other robots at which a search may begin, where the drawing led it astray.

With few records, and near a singularity at the drawing, the truth may lie beyond that singularity:
no way down the cost leads there. Robots are drawn from what the tolerances allow, and those that the
records contradict least are where a search has the best prospects.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.geometry import Geometry
from hexacell.identification.centring import Centring
from hexacell.identification.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.model import predict
from hexacell.identification.problem import Problem
from hexacell.pose import Poses
from hexacell.rotations import Array

DRAWN = 240
MOST_PROMISING = 12


def beginnings(problem: Problem) -> Iterator[tuple[Array, Poses]]:
    """Free parameters (p,), mm, the most promising first, and the poses that close them."""
    root = np.linalg.cholesky(problem.prior.covariance)
    draws = np.random.default_rng(0).standard_normal((DRAWN, len(root)))
    costs = np.array([_cost(problem, problem.begin + root @ draw) for draw in draws])
    order = np.argsort(costs, kind="stable")[:MOST_PROMISING]
    for row in order[np.isfinite(costs[order])]:
        free = problem.begin + root @ draws[row]
        yield free, _poses(problem, free)[0]


def _cost(problem: Problem, free: Array) -> float:
    """The weighted squares of the residuals; infinite where a record cannot be taken or says nothing."""
    poses, found = _poses(problem, free)
    if not found:
        return np.inf
    prediction = predict(problem, free, poses)
    if prediction.amplification.max() > LARGEST_AMPLIFICATION:
        return np.inf
    return float(Centring(problem, prediction.weights).cost(prediction.residuals))


def _poses(problem: Problem, free: Array) -> tuple[Poses, bool]:
    followed = problem.commands.followed(Geometry.from_vector(problem.basis @ free), problem.joints)
    return followed.poses, bool(followed.found.all())
