"""The identification of a geometry from records: with screening of the data, or online while measuring."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.choice_of_terms import choose_terms
from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.outlier_statistics import OutlierStatistics
from hexacell.identification.data_faults.stepwise_selection import (
    LARGEST_REJECTED_SHARE,
    Selection,
    UncorrectableFaultError,
    select_faults,
)
from hexacell.identification.data_faults.units import wrong_unit
from hexacell.identification.problem.problem import LEAST_SPARE_EQUATIONS, Problem
from hexacell.identification.solver import fit
from hexacell.identification.solver.result import GaugeFaultError, Identification
from hexacell.identification.terms.term import Finding, ModelTerm, TermFinding
from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import Array

SAME_AXIS_RATIO = 0.02
"""Rotations about other axes below this share of the largest ones are not intended."""

SMALLEST_ROTATION = 1e-3
"""rad, root mean square; below it the platform counts as not rotated."""


def identify(problem: Problem, *, find_outliers: bool = True) -> Identification:
    """Identify the geometry from all records, without those that have a data fault.

    Without ``find_outliers`` no record is tested, and all of them are used.

    Raises:
        IdentifiabilityError: the records cannot determine the parameters.
        GaugeFaultError: another unit, a gauge fault, or a zero shift that leaves too few records.
    """
    _require_enough_records(problem)
    _require_rotation_diversity(problem)
    if find_outliers and (fault := wrong_unit(problem)) is not None:
        raise GaugeFaultError(fault)
    try:
        selection, findings = _without_faults(problem) if find_outliers else (Selection.of_all(problem), ())
    except UncorrectableFaultError as refused:
        raise GaugeFaultError(messages.refused(refused)) from None
    found = replace(selection.selected.fit, data_faults=messages.left_out(selection), tried_terms=findings)
    _require_enough_records(found.problem)
    return found


def _without_faults(problem: Problem) -> tuple[Selection, tuple[TermFinding, ...]]:
    """The fit with the terms that the records show, without those of them that have a data fault.

    What terms explain is no fault: they are chosen first, and kept unless more records would be left out.

    Raises:
        UncorrectableFaultError: neither with terms nor without can the records be used.
    """
    if problem.terms is not None:  # known before: linearized once more where the robot is
        known = (TermFinding(term.name, Finding.KNOWN, 0.0) for term in problem.terms.terms)
        return select_faults(with_terms_of(problem, fit.fit_regularized(problem))), tuple(known)
    unknowns = (
        len(problem.prior.covariance)
        + problem.joints.shape[1] * len(problem.offered)
        + LEAST_SPARE_EQUATIONS
    )
    if not problem.offered or problem.equations < unknowns:
        return select_faults(problem), ()
    quick = fit.fit_regularized(problem, fit.QUICK)
    first = quick if quick.termination.converged else fit.fit_regularized(problem)
    chosen = choose_terms(first)
    if any(one.log_factor > 0.0 for one in chosen.findings):
        # What they do is linearized where they do not bend the geometry.
        chosen = choose_terms(_fitted_with(chosen.offered, problem, first))
    if not chosen.taken:
        return select_faults(problem, quick), chosen.findings
    nearly = _fitted_with(chosen.taken, problem, first)
    with_terms = with_terms_of(problem, nearly)
    if nearly.goodness.is_explained:
        return select_faults(with_terms), chosen.findings
    other, plain = _if_correctable(with_terms), _if_correctable(problem)
    if other is not None and (plain is None or other.badness <= plain.badness):
        return other, chosen.findings
    by_faults = (
        replace(one, finding=Finding.FAULTS) if one.finding is Finding.TAKEN else one
        for one in chosen.findings
    )
    return plain or select_faults(problem), tuple(by_faults)


def _fitted_with(terms: tuple[ModelTerm, ...], problem: Problem, first: Identification) -> Identification:
    """The fit with terms, linearized where a fit with them is, from one without."""
    nearly = fit.fit_regularized(problem.started_at(first.free).with_terms(terms))
    return fit.fit_regularized(with_terms_of(problem, nearly))


def with_terms_of(problem: Problem, found: Identification) -> Problem:
    """The problem of some records with the terms of an identification, linearized as these are there."""
    assert found.terms is not None  # noqa: S101 - it was fitted with them
    return problem.started_at(found.free).with_terms(found.terms.terms, found.terms.values)


def _if_correctable(problem: Problem) -> Selection | None:
    """The fit of what has no fault; None where that cannot be told or leaves too little."""
    try:
        return select_faults(problem)
    except UncorrectableFaultError:
        return None


def _require_enough_records(problem: Problem) -> None:
    """Require enough points and different poses to determine the parameters.

    Raises:
        IdentifiabilityError: names what is missing, and what to measure.
    """
    parameters = problem.unknowns or len(problem.prior.covariance)
    if problem.points < 2:
        raise IdentifiabilityError(
            f"records at one point cannot determine the {parameters} parameters, whatever their number",
            action="Measure at two points at least",
        )
    found = problem.equations
    if found < parameters:
        missing = -(-(parameters - found) // 3)
        repeated = problem.records - problem.different_poses
        repeats = f", {repeated} of them of a pose measured before," if repeated else ""
        raise IdentifiabilityError(
            f"{problem.records} records at {problem.points} points{repeats} give {found} equations for "
            f"{parameters} parameters",
            action=f"Measure {missing} more records at these points",
        )


def _require_rotation_diversity(problem: Problem) -> None:
    """Require that the orientations at the points differ by rotations about several axes, if they can.

    The principal axes are the eigenvectors of the rotation vectors' second moment.

    Raises:
        IdentifiabilityError: names the axis, and the rotations that are missing.
    """
    commanded = problem.commands.poses.rotations
    first = problem.per_record(commanded[problem.first_rows])
    # In the gauges' frame, from each point's first commanded orientation, rad.
    rotation_vectors = rotations.to_vector(commanded @ np.swapaxes(first, -1, -2)) @ problem.gauges
    squares, axes = np.linalg.eigh(rotation_vectors.T @ rotation_vectors)
    if squares[-1] < len(rotation_vectors) * SMALLEST_ROTATION**2:
        raise IdentifiabilityError(
            "the platform has one orientation in all records of a point",
            action="Measure each point in orientations tilted about x and about y, and turned about z",
        )
    can_tilt = {"a", "b"} & {*problem.mechanism.coordinates}
    if can_tilt and squares[-2] < SAME_AXIS_RATIO**2 * squares[-1]:
        axis, missing = _axis_and_missing(axes[:, -1])
        raise IdentifiabilityError(
            f"all orientations turn about {axis} only, and so they cannot determine all parameters",
            action=f"Measure orientations that {missing}",
        )


def _axis_and_missing(direction: Array) -> tuple[str, str]:
    rotations_about = {"x": "tilt about x", "y": "tilt about y", "z": "turn about z"}
    nearest = int(np.argmax(np.abs(direction)))
    if np.abs(direction[nearest]) < np.cos(0.1):
        x, y, z = direction * np.sign(direction[nearest])
        return f"the axis ({x:.2f}, {y:.2f}, {z:.2f})", "turn about axes across it too"
    axis = "xyz"[nearest]
    others = " and ".join(rotation for name, rotation in rotations_about.items() if name != axis)
    return axis, f"{others} too"


def estimate_online(problem: Problem, options: fit.SolverOptions = fit.COARSE) -> Identification:
    """Estimate the geometry from the records so far, with the full prior and without any check."""
    precision = problem.prior.precision
    kept, solution = fit.solve_around_singularities(problem, precision, options)
    return Identification(kept, solution, precision)


def without_gross_errors(found: Identification) -> Iterator[Identification]:
    """Online estimates without the most significant gross error, without two, and so on.

    Each continues the last one, needs no fit from the drawing, and looks for no cause: what is false, and
    why, is found from all records by :func:`identify`. Records are left out only while the others have
    equations to spare; fewer agree with anything, and prove nothing.
    """
    largest = LARGEST_REJECTED_SHARE * found.records
    rejected = 0
    while rejected < largest:
        ratio = OutlierStatistics.of(found.linear_model).threshold_ratio(rejected)
        kept = np.arange(found.records) != int(np.argmax(ratio))
        if ratio.max() <= 1.0 or not found.problem.subset(kept).is_overdetermined:
            return
        some = found.problem.starting_at(found.free, found.poses).subset(kept)
        problem, solution = fit.solve_around_singularities(some, found.active_prior, fit.INCREMENTAL)
        found, rejected = Identification(problem, solution, found.active_prior), rejected + 1
        yield found
