"""The identification of a geometry from records: with screening of the data, or online while measuring."""

from __future__ import annotations

import numpy as np

from hexacell.identification.data_faults.rejection import fit_unscreened, screen
from hexacell.identification.problem.data_requirements import (
    require_enough_records,
    require_rotation_diversity,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import nuisance_parameters, singular_records
from hexacell.identification.solver.chi_square import chi_square_test
from hexacell.identification.solver.levenberg_marquardt import COARSE, Solution, SolverOptions
from hexacell.identification.solver.result import DataFault, Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """Identify the geometry from all records, without those that have a data fault.

    With ``find_outliers`` false no record is tested.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters.
        GaugeFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    require_enough_records(problem)
    require_rotation_diversity(problem)
    screened = screen(problem) if find_outliers else fit_unscreened(problem)
    fit = screened.fit
    require_enough_records(fit.problem)
    return _result(fit.problem, fit.solution, fit.covariance, screened.data_faults)


def estimate_online(
    problem: Problem,
    *,
    free: Array | None = None,
    poses: PoseBatch | None = None,
    options: SolverOptions = COARSE,
) -> Identification:
    """Estimate the geometry from the records so far, with the full prior and without any check.

    The solver starts at ``free`` (p,), mm, with ``poses`` that close it at the problem's records, or
    at the problem's initial parameters.
    """
    precision = np.linalg.inv(problem.prior.covariance)
    if free is None or poses is None:
        free, poses = problem.initial_parameters, problem.start
    kept, solution = singular_records.solve_around_singularities(
        problem, precision, free=free, poses=poses, options=options
    )
    covariance = np.linalg.inv(solution.information + precision)
    return _result(kept, solution, covariance)


def _result(
    problem: Problem, solution: Solution, covariance: Array, data_faults: tuple[DataFault, ...] = ()
) -> Identification:
    basis = problem.basis
    covariance = 0.5 * (covariance + covariance.T)  # an inverse is symmetric to rounding only
    residuals = nuisance_parameters.centred(
        problem, solution.prediction.weights, solution.prediction.residuals
    )
    return Identification(
        geometry=problem.mechanism.convention.geometry(solution.free),
        covariance=basis @ covariance @ basis.T,
        free=solution.free,
        free_covariance=covariance,
        prior_sigma=basis @ np.sqrt(np.diag(problem.prior.covariance)),
        problem=problem,
        poses=solution.prediction.poses,
        residual_rms_mm=float(np.sqrt(np.mean(residuals**2))),
        goodness=chi_square_test(problem, solution.chi2, covariance, solution.information),
        dof=3 * (problem.records - problem.points) - len(solution.free),
        iterations=solution.iterations,
        termination=solution.termination,
        frame=problem.mechanism.convention.name,
        data_faults=data_faults,
    )
