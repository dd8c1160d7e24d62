"""The identification: what ``fit`` does, and everything else the program asks of the estimator."""

from __future__ import annotations

import numpy as np

from hexacell.geometry import Geometry
from hexacell.identification import centring, detour
from hexacell.identification.cleaning import Cleaned, clean, leave_alone
from hexacell.identification.levenberg_marquardt import FAR_AWAY, Manner, Solution
from hexacell.identification.problem import Problem
from hexacell.identification.refusals import refuse_one_axis, refuse_too_little
from hexacell.identification.result import Identification
from hexacell.pose import Poses
from hexacell.rotations import Array


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """The geometry that explains the records, from the drawing on.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters, or gauges were misread
            (:class:`~hexacell.identification.anomaly.FalseReadings`).
    """
    refuse_too_little(problem)
    refuse_one_axis(problem)
    cleaned = clean(problem) if find_outliers else leave_alone(problem)
    refuse_too_little(cleaned.fit.problem)
    found = cleaned.fit
    return _result(found.problem, found.solution, found.covariance, cleaned)


def track(
    problem: Problem,
    *,
    free: Array | None = None,
    poses: Poses | None = None,
    manner: Manner = FAR_AWAY,
) -> Identification:
    """The estimate while measuring: prior in full, nothing refused.

    The search begins at ``free`` (p,), mm, with ``poses`` that close it at the problem's records, or
    else at the drawing.
    """
    precision = np.linalg.inv(problem.prior.covariance)
    if free is None or poses is None:
        free, poses = problem.begin, problem.start
    kept, solution = detour.solve(problem, precision, free=free, poses=poses, manner=manner)
    covariance = np.linalg.inv(solution.information + precision)
    return _result(kept, solution, covariance)


def _result(
    problem: Problem, solution: Solution, covariance: Array, cleaned: Cleaned | None = None
) -> Identification:
    basis = problem.basis
    covariance = 0.5 * (covariance + covariance.T)  # an inverse is symmetric to rounding only
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
        outliers=cleaned.outliers if cleaned else (),
        anomalies=cleaned.anomalies if cleaned else (),
        frame=problem.mechanism.convention.name,
    )
