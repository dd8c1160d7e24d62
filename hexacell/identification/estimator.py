"""The identification of a geometry from records: with screening of the data, or online while measuring."""

from __future__ import annotations

from hexacell.identification.data_faults.rejection import screen
from hexacell.identification.problem.data_requirements import (
    require_enough_records,
    require_rotation_diversity,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import COARSE, SolverOptions
from hexacell.identification.solver.regularized_fit import fit_regularized
from hexacell.identification.solver.result import Identification
from hexacell.identification.solver.singular_records import solve_around_singularities


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """Identify the geometry from all records, without those that have a data fault.

    With ``find_outliers`` false no record is tested.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters.
        GaugeFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    require_enough_records(problem)
    require_rotation_diversity(problem)
    found = screen(problem) if find_outliers else fit_regularized(problem)
    require_enough_records(found.problem)
    return found


def estimate_online(problem: Problem, options: SolverOptions = COARSE) -> Identification:
    """Estimate the geometry from the records so far, with the full prior and without any check."""
    precision = problem.prior.precision
    kept, solution = solve_around_singularities(problem, precision, options)
    return Identification(kept, solution, precision)
