"""Stepwise selection of data faults: forward by penalized score tests, backward by deletion tests.

A fault hypothesis h adds k unknowns b to the linear model, ``r = r0 + J x + Z b``. Its gain, the
decrease of the chi-square, is a score statistic that needs no second fit (:mod:`.score_tests`);
its cost is ``c k - gain``, like Schwarz's criterion (BIC) with a constant c instead of log n.
Starting with no fault at all:

1. Forward. Fit the records. Of all significant hypotheses take the one of lowest cost that a refit
   of the corrected records confirms, and repeat. Where the fit is unreliable, first-order tests
   around it are not valid: hypotheses are tried by refits instead (:mod:`.hypothesis_search`).
2. Backward. Test each rejected record against the final fit, in which it takes no part, readmit
   those that agree, and go forward again.
3. Proof. Readmit those whose fault the rest of the records does not prove (:mod:`.proof`).

Gross errors, and all records after a shift of a gauge's zero, are left out. Gauge faults are
refused: their readings would have to be guessed, so a person has to check the machine or the file.

Sources: Rao 1948 (score test); Baarda 1968 and Pope, The Statistics of Residuals and the Detection of
Outliers, NOAA NOS 65 NGS 1, 1976 (data snooping, one outlier after another); Atkinson and Riani 2000
(several outliers, backward test by deletion); Schwarz, Estimating the Dimension of a Model, Annals of
Statistics 6, 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.fault_model import CorrectedFit, FaultHypothesis
from hexacell.identification.data_faults.hypotheses import (
    ALL_IN_INCHES,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
    record_ids,
    record_mask,
)
from hexacell.identification.data_faults.hypothesis_search import (
    LARGEST_REJECTED_SHARE,
    hypotheses_at_solution,
    search,
)
from hexacell.identification.data_faults.proof import proven_faults
from hexacell.identification.data_faults.record_test import DeletionTest, deletion_test
from hexacell.identification.problem.data_requirements import equations, is_determined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import FINE
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.regularized_fit import fit_regularized
from hexacell.identification.solver.result import DataFault, GaugeFaultError, Identification
from hexacell.measurements.records import RecordId

FEW_RECORDS = 60
"""Up to this number of records the cost may have several minima."""

OTHER_STARTS = 4
"""With few records, the start points that are tried before a gauge fault is reported."""

LARGEST_MEAN_SQUARE = 3.0
"""Of the difference from the drawing, in sigma, of a solution found from another start point."""


def screen(problem: Problem) -> Identification:
    """Fit a problem without the records that disagree with the others.

    Raises:
        GaugeFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    try:
        selected = _stepwise_selection(problem)
    except GaugeFaultError:
        other = _other_minimum(problem)
        if other is None:
            raise
        return other
    return replace(selected.fit, data_faults=_data_faults(selected))


def _stepwise_selection(problem: Problem) -> CorrectedFit:
    uncorrected = CorrectedFit.uncorrected(problem)
    selected = _forward(uncorrected)
    if len(_rejected(selected)) > 1 or not selected.is_consistent:
        _refuse_inches(uncorrected)
    readmitted = _readmit(selected)
    return _only_proven(selected if readmitted is None else _forward(readmitted))


def _forward(current: CorrectedFit) -> CorrectedFit:
    """Correct for the most likely hypothesis until none is significant, or too many were rejected."""
    while len(_rejected(current)) < LARGEST_REJECTED_SHARE * current.original.records:
        extended = None
        if not current.is_reliable:
            extended = search(current)
            current = current if extended else current.converged()
        if extended is None and current.is_reliable:
            extended = _most_likely(current)
        if extended is None:
            break
        _require_correctable(current, extended)
        current = extended
    return current


def _most_likely(current: CorrectedFit) -> CorrectedFit | None:
    """The fit corrected for the hypothesis of lowest cost that is confirmed."""
    ranked = hypotheses_at_solution(current, found_before=len(_rejected(current)))
    confirmed = (hypothesis.confirmed(current) for hypothesis in ranked)
    return next((extended for extended in confirmed if extended), None)


def _require_correctable(current: CorrectedFit, extended: CorrectedFit) -> None:
    """Raise where the additional faults cannot be corrected by leaving records out."""
    problem = current.problem
    for fault in extended.faults[len(current.faults) :]:
        problem = fault.corrected(problem)
        if isinstance(fault, GaugeFaultHypothesis):
            before, after = current.fit.goodness, extended.fit.goodness
            raise GaugeFaultError(messages.gauge_fault(fault, before, after, lost=current.lost))
        if isinstance(fault, ZeroShiftHypothesis) and not is_determined(problem):
            raise GaugeFaultError(messages.refused_zero_shift(fault, equations(problem)))


def _refuse_inches(uncorrected: CorrectedFit) -> None:
    """Readings in inches resemble a machine that needs no calibration, with some gross errors."""
    in_mm = ALL_IN_INCHES.trial(uncorrected)
    if in_mm is not None and in_mm.is_consistent:
        _require_correctable(uncorrected, in_mm)


def _only_proven(selected: CorrectedFit) -> CorrectedFit:
    """The fit without only those records that are proven false by the rest, which grows meanwhile."""
    proven = proven_faults(selected, _deletion_tests(selected))
    while proven != selected.faults:
        selected = _refit(selected, proven)
        proven = proven_faults(selected, _deletion_tests(selected))
    return selected


def _refit(selected: CorrectedFit, faults: tuple[FaultHypothesis, ...]) -> CorrectedFit:
    """The fit corrected for some of the faults only."""
    problem = selected.original
    for fault in faults:
        problem = fault.corrected(problem)
    solved = problem.solve_poses(selected.fit.free)
    if solved.found.all():
        problem = problem.starting_at(selected.fit.free, solved.poses, solved.found)
    return CorrectedFit(selected.original, problem, fit_regularized(problem), faults)


def _readmit(selected: CorrectedFit) -> CorrectedFit | None:
    """The fit with the rejected records that agree with it; none if there are none."""
    agreeing = _agreeing(selected)
    if not agreeing:
        return None
    original = selected.original
    problem = original.subset(record_mask(original, agreeing.union(record_ids(selected.fit.problem))))
    solved = problem.solve_poses(selected.fit.free)
    if not solved.found.all():
        return None
    again = fit_regularized(problem.starting_at(selected.fit.free, solved.poses, solved.found), FINE)
    readmitted = CorrectedFit(original, problem, again, _without(agreeing, selected.faults))
    return readmitted if readmitted.is_reliable else None


def _without(records: set[RecordId], faults: Sequence[FaultHypothesis]) -> tuple[FaultHypothesis, ...]:
    """The faults without the gross errors of some records."""
    return tuple(
        fault.of([record for record in fault.records if record not in records])
        if isinstance(fault, OutlierHypothesis)
        else fault
        for fault in faults
    )


def _agreeing(selected: CorrectedFit) -> set[RecordId]:
    """Rejected records that agree; the fewer disagree, the more significantly one has to."""
    tests = _deletion_tests(selected)
    disagreeing = sum(not test.agrees() for test in tests.values())
    return {record for record, test in tests.items() if test.agrees(max(0, disagreeing - 1))}


def _deletion_tests(selected: CorrectedFit) -> dict[RecordId, DeletionTest]:
    """Tests of gross errors and of records that the solver left out, not of those after a zero shift."""
    if selected.fit.records == selected.original.records:
        return {}
    excluded = {record for shift in _zero_shifts(selected) for record in _after(shift, selected)}
    excluded.update(record_ids(selected.fit.problem))
    return {
        record: deletion_test(selected.original, record, selected.fit)
        for record in record_ids(selected.original)
        if record not in excluded
    }


def _rejected(current: CorrectedFit) -> list[RecordId]:
    """The records rejected for gross errors."""
    outliers = (fault for fault in current.faults if isinstance(fault, OutlierHypothesis))
    return [record for outlier in outliers for record in outlier.records]


def _zero_shifts(current: CorrectedFit) -> list[ZeroShiftHypothesis]:
    return [fault for fault in current.faults if isinstance(fault, ZeroShiftHypothesis)]


def _after(shift: ZeroShiftHypothesis, current: CorrectedFit) -> list[RecordId]:
    """All records after a zero shift."""
    return record_ids(current.original.subset(shift.rows(current.original)))


def _data_faults(selected: CorrectedFit) -> tuple[DataFault, ...]:
    """What is wrong with the records that were left out."""
    records = [test.fault for test in _deletion_tests(selected).values()]
    shifts = [messages.zero_shift(shift, _after(shift, selected)) for shift in _zero_shifts(selected)]
    return (*records, *shifts)


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
