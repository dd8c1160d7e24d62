"""The identification: what ``fit`` does, and everything else the program asks of the estimator."""

from __future__ import annotations

import numpy as np

from hexacell.identification.data_faults.rejection import ScreenedFit, fit_unscreened, screen
from hexacell.identification.problem.data_requirements import (
    require_enough_records,
    require_rotation_diversity,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import nuisance_parameters, singular_records
from hexacell.identification.solver.levenberg_marquardt import COARSE, Solution, SolverOptions
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """The geometry that explains the records, from the drawing on.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters, or gauges were misread
            (:class:`~hexacell.identification.solver.result.GaugeFaultError`).
    """
    require_enough_records(problem)
    require_rotation_diversity(problem)
    cleaned = screen(problem) if find_outliers else fit_unscreened(problem)
    require_enough_records(cleaned.fit.problem)
    found = cleaned.fit
    return _result(found.problem, found.solution, found.covariance, cleaned)


def estimate_online(
    problem: Problem,
    *,
    free: Array | None = None,
    poses: PoseBatch | None = None,
    manner: SolverOptions = COARSE,
) -> Identification:
    """The estimate while measuring: prior in full, nothing refused.

    The search begins at ``free`` (p,), mm, with ``poses`` that close it at the problem's records, or
    else at the drawing.
    """
    precision = np.linalg.inv(problem.prior.covariance)
    if free is None or poses is None:
        free, poses = problem.initial_parameters, problem.start
    kept, solution = singular_records.solve_around_singularities(
        problem, precision, free=free, poses=poses, manner=manner
    )
    covariance = np.linalg.inv(solution.information + precision)
    return _result(kept, solution, covariance)


def _result(
    problem: Problem, solution: Solution, covariance: Array, cleaned: ScreenedFit | None = None
) -> Identification:
    basis = problem.basis
    covariance = 0.5 * (covariance + covariance.T)  # an inverse is symmetric to rounding only
    residuals = nuisance_parameters.centred(
        problem, solution.prediction.weights, solution.prediction.residuals
    )
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
