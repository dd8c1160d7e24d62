"""The identification: solve, release the prior where the data speak, leave out gross errors.

The tolerance prior keeps the solver on the road from the drawing and holds what the data do not
determine. In a direction that the data determine much better than the drawing does, it would only
bias the result toward the drawing; there it is released, and the estimate is the data's alone.
"""

from __future__ import annotations

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.geometry import Geometry
from hexacell.identification import centring, detour, outliers
from hexacell.identification.levenberg_marquardt import NEARBY, Solution, solve
from hexacell.identification.problem import Problem
from hexacell.identification.result import Identification, Outlier
from hexacell.pose import Poses
from hexacell.rotations import Array

RELEASE_RATIO = 9.0
"""Data information over prior information from which on the data speak alone (sigma a third)."""


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """The geometry that explains the records, from the drawing on.

    Raises:
        IdentifiabilityError: fewer records or points than the parameters need.
    """
    refuse_too_little(problem)
    kept, solution, covariance = _solve_with_release(problem)
    left_out: tuple[Outlier, ...] = ()
    while find_outliers and len(left_out) < outliers.LARGEST_SHARE * problem.records:
        row, outlier = _worst(kept, solution, covariance)
        if outlier is None:
            break
        left_out = (*left_out, outlier)
        problem = problem.keeping(np.any(problem.labels != kept.labels[row], axis=1))
        kept, solution, covariance = _solve_with_release(problem)
    return _result(kept, solution, covariance, left_out)


def track(problem: Problem, *, free: Array | None = None, poses: Poses | None = None) -> Identification:
    """The estimate while measuring: prior in full, nothing refused, warm-started where possible.

    ``free`` (p,), mm, and ``poses`` that close it at the problem's records continue a former one.
    """
    precision = np.linalg.inv(problem.prior.covariance)
    if free is None or poses is None:
        free, poses = problem.mechanism.convention.free_part(problem.prior.centre), problem.start
    kept, solution = detour.solve(problem, precision, free=free, poses=poses)
    covariance = np.linalg.inv(solution.information + precision)
    return _result(kept, solution, covariance, ())


def refuse_too_little(problem: Problem) -> None:
    """Raise where the number of records or points alone shows that nothing can be identified.

    Raises:
        IdentifiabilityError: says what is missing.
    """
    parameters = problem.prior.covariance.shape[0]
    if problem.points < 2:
        raise IdentifiabilityError(
            f"records at one point cannot determine the {parameters} parameters, however many they are",
            action="Measure at two points at least",
        )
    equations = 3 * (problem.records - problem.points)
    if equations < parameters:
        missing = -(-(parameters - equations) // 3)
        raise IdentifiabilityError(
            f"{problem.records} records at {problem.points} points give {equations} equations for "
            f"{parameters} parameters",
            action=f"Measure {missing} more records at these points",
        )


def _solve_with_release(problem: Problem) -> tuple[Problem, Solution, Array]:
    precision = np.linalg.inv(problem.prior.covariance)
    centre = problem.mechanism.convention.free_part(problem.prior.centre)
    kept, cautious = detour.solve(problem, precision, free=centre, poses=problem.start)
    held = _precision_where_silent(cautious.information, problem.prior.covariance)
    solution = solve(kept, held, free=cautious.free, poses=cautious.prediction.poses, manner=NEARBY)
    return kept, solution, np.linalg.inv(solution.information + held)


def _precision_where_silent(information: Array, prior_covariance: Array) -> Array:
    """The prior's precision in the directions that the data leave open, zero in the others."""
    factor = np.linalg.cholesky(prior_covariance)
    ratios, directions = np.linalg.eigh(factor.T @ information @ factor)
    silent = directions[:, ratios < RELEASE_RATIO]
    back = np.linalg.solve(factor.T, silent)
    return back @ back.T


def _worst(problem: Problem, solution: Solution, covariance: Array) -> tuple[int, Outlier | None]:
    values = outliers.statistics(problem, solution.prediction, covariance)
    row = int(np.argmax(values))
    if values[row] <= outliers.threshold(values):
        return row, None
    point, orientation = problem.labels[row]
    return row, Outlier(int(point), int(orientation), float(values[row]))


def _result(
    problem: Problem, solution: Solution, covariance: Array, left_out: tuple[Outlier, ...]
) -> Identification:
    basis = problem.basis
    residuals = centring.centred(problem, solution.prediction.weights, solution.prediction.residuals)
    return Identification(
        geometry=Geometry.from_vector(basis @ solution.free),
        covariance=basis @ covariance @ basis.T,
        free=solution.free,
        free_covariance=covariance,
        prior_sigma=basis @ np.sqrt(np.diag(problem.prior.covariance)),
        problem=problem,
        poses=solution.prediction.poses,
        residual_rms_mm=float(np.sqrt(np.mean(residuals**2))),
        chi2=solution.chi2,
        dof=3 * (problem.records - problem.points) - len(solution.free),
        iterations=solution.iterations,
        termination=solution.termination,
        outliers=left_out,
        frame=problem.mechanism.convention.name,
    )
