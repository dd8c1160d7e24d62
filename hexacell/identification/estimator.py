"""The identification of a geometry from records: with screening of the data, or online while measuring."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.hypotheses import OutlierStatistics
from hexacell.identification.data_faults.stepwise_selection import (
    LARGEST_REJECTED_SHARE,
    UncorrectableFaultError,
    select_faults,
)
from hexacell.identification.problem.data_requirements import (
    require_enough_records,
    require_rotation_diversity,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.fit import (
    COARSE,
    INCREMENTAL,
    SolverOptions,
    fit_regularized,
    solve_around_singularities,
)
from hexacell.identification.solver.result import GaugeFaultError, Identification


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """Identify the geometry from all records, without those that have a data fault.

    Args:
        problem: n records, with the prior and the noise.
        find_outliers: whether records are tested; without it all of them are used.

    Returns:
        The p free parameters, mm, with their covariance (p, p), mm^2, and what is wrong with the records
        that were left out.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters.
        GaugeFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    require_enough_records(problem)
    require_rotation_diversity(problem)
    if find_outliers:
        try:
            selection = select_faults(problem)
        except UncorrectableFaultError as refused:
            raise GaugeFaultError(messages.refused(refused)) from None
        found = replace(selection.selected.fit, data_faults=messages.left_out(selection))
    else:
        found = fit_regularized(problem)
    require_enough_records(found.problem)
    return found


def estimate_online(problem: Problem, options: SolverOptions = COARSE) -> Identification:
    """Estimate the geometry from the records so far, with the full prior and without any check.

    Args:
        problem: n records; with few of them, the prior determines the rest.
        options: of the solver, which starts at the initial parameters of the problem.
    """
    precision = problem.prior.precision
    kept, solution = solve_around_singularities(problem, precision, options)
    return Identification(kept, solution, precision)


def without_gross_errors(found: Identification) -> Iterator[Identification]:
    """Estimates without the most significant gross error, without two, and so on.

    Each continues the last one, needs no fit from the drawing, and looks for no cause: what is false, and
    why, is found from all records by :func:`identify`. Records are left out only while the others have
    equations to spare; fewer agree with anything, and prove nothing.

    Args:
        found: an online estimate.
    """
    largest = LARGEST_REJECTED_SHARE * found.records
    rejected = 0
    while rejected < largest:
        ratio = OutlierStatistics.of(found.linear_model).threshold_ratio(rejected)
        kept = np.arange(found.records) != int(np.argmax(ratio))
        if ratio.max() <= 1.0 or not found.problem.subset(kept).is_overdetermined:
            return
        everywhere = np.ones(found.records, dtype=bool)
        some = found.problem.starting_at(found.free, found.poses, everywhere).subset(kept)
        problem, solution = solve_around_singularities(some, found.active_prior, INCREMENTAL)
        found, rejected = Identification(problem, solution, found.active_prior), rejected + 1
        yield found
