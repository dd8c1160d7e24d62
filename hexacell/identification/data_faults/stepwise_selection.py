"""Stepwise selection of data faults: forward by penalized score tests, backward by deletion tests.

A fault hypothesis adds k unknowns to the linear model. Its gain, the decrease of the chi-square, needs no
second fit (:mod:`.score_tests`); its cost is ``c k - gain``, like Schwarz's criterion with a constant c
instead of log n. Starting with no fault at all (:func:`select_faults`):

1. Forward (:func:`_forward`). Of all significant hypotheses take the one of lowest cost that a refit of the
   corrected records confirms, and repeat. Where the fit is unreliable, hypotheses are tried by refits
   instead (:mod:`.trial_fits`).
2. Backward (:func:`_readmitted`). Readmit the rejected records that agree with the final fit, in which they
   take no part, and go forward again.
3. Proof (:func:`_only_proven`). Readmit those whose fault the rest of the records does not prove
   (:mod:`.deletion_tests`).

Gross errors, and all records after a shift of a gauge's zero, are left out. Gauge faults are refused, after
other starts of the solver were tried (:func:`_other_minimum`). :mod:`.messages` puts faults into words.

Sources: Efroymson 1960 (stepwise selection); Rao 1948 (score test); Baarda 1968, Pope 1976 (data snooping);
Atkinson and Riani 2000 (several outliers); Schwarz, Annals of Statistics 6, 1978.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.deletion_tests import deletion_tests, proven_faults
from hexacell.identification.data_faults.hypotheses import (
    ALL_IN_INCHES,
    FaultHypothesis,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
)
from hexacell.identification.data_faults.trial_fits import (
    LARGEST_REJECTED_SHARE,
    CorrectedFit,
    UncorrectableFaultError,
    hypotheses_at_solution,
    refitted,
    search,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.fit import FINE, fit_regularized
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.result import GaugeFaultError, Identification

CONFIRMED_SHARE = 0.5
"""Share of the first-order gain of a gauge fault that a refit must confirm."""

FEW_RECORDS = 60
"""Up to this number of records the cost may have several minima."""

OTHER_STARTS = 4
"""With few records, the start points that are tried before a gauge fault is reported."""

LARGEST_MEAN_SQUARE = 3.0
"""Largest mean square difference from the drawing, in sigma, of a solution from another start."""


def screen(problem: Problem) -> Identification:
    """Fit a problem without the records that disagree with the others.

    Args:
        problem: all records, at least as many as determine the parameters.

    Returns:
        The fit of the other records, with what is wrong with those that are left out.

    Raises:
        GaugeFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    try:
        selected = select_faults(problem)
    except UncorrectableFaultError as refused:
        other = _other_minimum(problem)
        if other is None:
            raise GaugeFaultError(messages.refused(refused)) from None
        return other
    return replace(selected.fit, data_faults=messages.left_out(selected, deletion_tests(selected)))


def select_faults(problem: Problem) -> CorrectedFit:
    """The fit of a problem that is corrected for all faults that are found and proven.

    Raises:
        UncorrectableFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    uncorrected = CorrectedFit.uncorrected(problem)
    selected = _forward(uncorrected)
    if len(selected.rejected) > 1 or not selected.is_consistent:
        # Readings in inches resemble a machine that needs no calibration, with some gross errors.
        in_mm = refitted(uncorrected, ALL_IN_INCHES)
        if in_mm is not None and in_mm.is_consistent:
            _require_correctable(uncorrected, in_mm)
    readmitted = _readmitted(selected)
    return _only_proven(selected if readmitted is None else _forward(readmitted))


def _forward(current: CorrectedFit) -> CorrectedFit:
    """Correct for the most likely hypothesis until nothing is significant, or too many were rejected."""
    while len(current.rejected) < LARGEST_REJECTED_SHARE * current.original.records:
        extended = None if current.is_reliable else search(current)
        if extended is None:
            current = current.converged()
            # The hypothesis of lowest cost that is confirmed.
            ranked = hypotheses_at_solution(current, len(current.rejected)) if current.is_reliable else ()
            confirmed = (confirmed_by_refit(current, hypothesis) for hypothesis in ranked)
            extended = next(filter(None, confirmed), None)
        if extended is None:
            break
        _require_correctable(current, extended)
        current = extended
    return current


def confirmed_by_refit(current: CorrectedFit, hypothesis: FaultHypothesis) -> CorrectedFit | None:
    """The fit corrected for one more fault; None if it does not confirm that fault.

    Without gross errors the other records must determine the parameters. Without a gauge fault the fit
    must have a sufficient part of the first-order gain, and be a proof: it agrees with the noise, or is
    better by far.
    """
    if (
        isinstance(hypothesis, OutlierHypothesis)
        and not hypothesis.corrected(current.problem).is_determined
    ):
        return None
    corrected = refitted(current, hypothesis)
    if corrected is None or not isinstance(hypothesis, GaugeFaultHypothesis):
        return corrected
    limit = current.fit.chi2 - CONFIRMED_SHARE * hypothesis.gain
    is_proof = corrected.is_consistent or corrected.is_better_by_far_than(current)
    return corrected if is_proof and corrected.fit.chi2 < limit else None


def _require_correctable(current: CorrectedFit, extended: CorrectedFit) -> None:
    """Raise where the additional faults cannot be corrected by leaving records out."""
    left = current.problem
    for fault in extended.faults[len(current.faults) :]:
        left = fault.corrected(left)
        is_refused_shift = isinstance(fault, ZeroShiftHypothesis) and not left.is_determined
        if is_refused_shift or isinstance(fault, GaugeFaultHypothesis):
            raise UncorrectableFaultError(fault, current, extended, left)


def _readmitted(selected: CorrectedFit) -> CorrectedFit | None:
    """The fit with the rejected records that agree with it; None if no record agrees, or it is unreliable.

    The fewer disagree, the more significantly a record has to.
    """
    tests = deletion_tests(selected)
    disagreeing = sum(not test.agrees() for test in tests.values())
    agreeing = {record for record, test in tests.items() if test.agrees(max(0, disagreeing - 1))}
    if not agreeing:
        return None
    problem = selected.original
    problem = problem.subset(problem.mask_of(agreeing.union(selected.fit.problem.record_ids)))
    solved = problem.solve_poses(selected.fit.free)
    if not solved.found.all():
        return None
    fit = fit_regularized(problem.starting_at(selected.fit.free, solved.poses, solved.found), FINE)
    faults = tuple(
        fault.only(set(fault.records) - agreeing) if isinstance(fault, OutlierHypothesis) else fault
        for fault in selected.faults
    )
    readmitted = CorrectedFit(selected.original, problem, fit, faults)
    return readmitted if readmitted.is_reliable else None


def _only_proven(selected: CorrectedFit) -> CorrectedFit:
    """The fit without only those records that are proven false by the rest, which grows meanwhile."""
    while (proven := proven_faults(selected, deletion_tests(selected))) != selected.faults:
        problem = selected.original
        for fault in proven:
            problem = fault.corrected(problem)
        solved = problem.solve_poses(selected.fit.free)
        if solved.found.all():
            problem = problem.starting_at(selected.fit.free, solved.poses, solved.found)
        selected = CorrectedFit(selected.original, problem, fit_regularized(problem), proven)
    return selected


def _other_minimum(problem: Problem) -> Identification | None:
    """A fit within the tolerances that explains all readings as they are, from another start."""
    if problem.records > FEW_RECORDS:
        return None
    everywhere = np.ones(problem.records, dtype=bool)
    largest = LARGEST_MEAN_SQUARE * len(problem.prior.free)
    for restarted in islice(restarts(problem), OTHER_STARTS):
        found = CorrectedFit.uncorrected(replace(restarted, has_start_pose=everywhere))
        if found.is_consistent and problem.prior.squared_distance(found.fit.free) <= largest:
            return found.fit
    return None
