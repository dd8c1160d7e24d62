"""Random multistart: other start points for the solver if it finds a wrong minimum from the drawing.

With few records, and a pose near a singularity at the drawing, the true geometry may lie beyond that
singularity, where no descent from the drawing ends. Geometries are drawn within the tolerances,
and those of lowest cost are the start points. The poses of all draws are solved in one batch.

Source: Rinnooy Kan and Timmer, Stochastic global optimization methods, Mathematical Programming 39, 1987.
"""

from collections.abc import Iterator

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import NuisanceElimination, predict
from hexacell.kinematics.geometry import GeometryBatch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

DRAWS = 240
START_POINTS = 12

BATCH_ROWS = 20_000
"""Poses solved at once, for the sake of memory."""


def restarts(problem: Problem) -> Iterator[Problem]:
    """The problem with other start points, that of lowest cost first."""
    reached = list(_with_poses(problem, problem.initial_parameters + tolerance_draws(problem)))
    costs = np.full(len(reached), np.inf)  # next to a singularity
    for row, (free, poses) in enumerate(reached):
        prediction = predict(problem, free, poses)
        if not prediction.singular.any():
            costs[row] = NuisanceElimination(problem, prediction.weights).cost(prediction.residuals)
    order = np.argsort(costs, kind="stable")[:START_POINTS]
    for row in order[np.isfinite(costs[order])]:
        yield problem.starting_at(*reached[row])


def tolerance_draws(problem: Problem) -> Array:
    """Changes of the free parameters (k, p), mm: by the prior, and by each parameter's own tolerance.

    The frames make the prior so wide in some directions that few of its draws are near the drawing.
    """
    root = np.linalg.cholesky(problem.prior.covariance)
    normal = np.random.default_rng(0).standard_normal((2, DRAWS // 2, len(root)))
    return np.asarray(np.concatenate([normal[0] @ root.T, normal[1] * problem.prior.sigma]))


def _with_poses(problem: Problem, starts: Array) -> Iterator[tuple[Array, PoseBatch]]:
    """The free parameters, of (k, p), mm, for which the poses of all records are found, with the poses."""
    records = problem.records
    for some in np.array_split(starts, -(-len(starts) * records // BATCH_ROWS)):
        rows = np.tile(np.arange(records), len(some))
        vectors = np.repeat(some @ problem.basis.T, records, axis=0)
        geometries = GeometryBatch(problem.mechanism.parameters, vectors)
        solved = problem.commands[rows].solve_poses(geometries, problem.joints[rows])
        for start in np.flatnonzero(solved.found.reshape(len(some), records).all(axis=1)):
            yield some[start], solved.poses[start * records + np.arange(records)]
