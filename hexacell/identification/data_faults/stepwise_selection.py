"""Stepwise selection of data faults: forward by penalized score tests, backward by deletion tests.

A fault hypothesis adds k unknowns to the linear model. Its gain, the decrease of the chi-square, needs no
second fit (:mod:`.hypotheses`); its cost is ``c k - gain``, like Schwarz's criterion with a constant c
instead of log n. Starting with no fault at all (:func:`select_faults`):

1. Forward (:func:`_forward`). Of all significant hypotheses take the one of lowest cost that a refit of the
   corrected records confirms, and repeat. Where the fit is unreliable, hypotheses are tried by refits
   instead (:func:`_searched`).
2. Backward (:func:`_readmitted`). Readmit the rejected records that agree with the final fit, in which they
   take no part, and go forward again.
3. Proof (:func:`_only_proven`; ``docs/method.md``, Proof). Readmit those whose fault the other records do
   not prove: the less these agree with the stated noise, the further beyond its critical value the
   statistic of a fault must be. What is not proven stays in the fit, and no cause is named. The factors
   separate the worlds of ``tests/benchmarks/worlds``: the largest statistic of an imperfect machine is 4.1
   critical values, and that of a reading off by 0.5 mm in a good one at least 4.8.

Gross errors, and all records after a shift of a gauge's zero, are left out. Gauge faults are refused if
all that was found explains the records, or as much as a geometry within the tolerances can in a machine
that no model explains, and no fit explains them as they are (:func:`_other_minimum`).

First-order tests around a wrong solution are unreliable. The drawing is a better expansion point: it is
within millimetres of the truth, whatever the gauges read. What is tried by refits, in this order
(:func:`_candidates`):

1. without the records that the solver left out, if they are few;
2. the most likely gauge fault around the drawing, and the most likely hypothesis around the solution;
3. greedy deletion: the most likely fault is left out, with a refit after each (:func:`_greedy_deletion`);
4. what all records have in common around the fit without the deleted ones;
5. the next gauge faults and hypotheses of 2, and every gauge fault at all points.

Sources: Efroymson 1960 (stepwise selection); Rao 1948 (score test); Baarda 1968, Pope 1976 (data snooping);
Atkinson and Riani 2000 (several outliers, which hide each other around a fit to all of them, and show
around one that they did not influence); Schwarz, Annals of Statistics 6, 1978.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, islice, repeat

from hexacell.identification.data_faults.corrected_fit import CorrectedFit
from hexacell.identification.data_faults.deletion_tests import DeletionTest
from hexacell.identification.data_faults.hypotheses import (
    ALL_IN_INCHES,
    FaultHypothesis,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.fit import COARSE, QUICK, fit_regularized
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.result import Identification
from hexacell.measurements.records import RecordId

LARGEST_REJECTED_SHARE = 0.1
"""Share of all records above which those that disagree are not single mistakes."""

TRIED_FIRST = 2
"""Likely hypotheses that are tried before, and right after, the most likely are left out at once."""

CONFIRMED_SHARE = 0.5
"""Share of the first-order gain of a gauge fault that a refit must confirm."""

SHOWN_DECREASE = 2.0
"""Factor of the mean square residual that a gauge fault must explain: readings near 0 show none."""

FEW_RECORDS = 60
"""Up to this number of records the cost may have several minima."""

OTHER_STARTS = 4
"""With few records, the start points that are tried before a gauge fault is reported."""

GOOD_AGREEMENT = 0.05
"""Probability of the residuals of the rest from which they agree well."""

BESIDE_GOOD, BESIDE_AGREEING, BESIDE_DISAGREEING = 1.3, 4.0, 10.0


class UncorrectableFaultError(Exception):
    """A fault of the records that cannot be corrected by leaving some of them out.

    Attributes:
        before: the fit that does not explain it.
        after: the fit corrected for it, and for what else was found.
        left: the records that are left without it.
    """

    def __init__(
        self, fault: FaultHypothesis, before: CorrectedFit, after: CorrectedFit, left: Problem
    ) -> None:
        super().__init__(fault)
        self.fault, self.before, self.after, self.left = fault, before, after, left


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """The fit without the records whose faults are proven, and the deletion tests of these records."""

    selected: CorrectedFit
    tests: dict[RecordId, DeletionTest]

    @property
    def badness(self) -> tuple[bool, int]:
        """Whether the residuals are not explained, and how many records were left out."""
        return not self.selected.fit.goodness.is_explained, len(self.selected.rejected)

    @classmethod
    def of_all(cls, problem: Problem) -> Selection:
        """The fit of all records as measured, whatever is wrong with them."""
        return cls(CorrectedFit.uncorrected(problem, COARSE), {})


def select_faults(problem: Problem, fit: Identification | None = None) -> Selection:
    """Fit a problem, corrected for all faults that are found and proven, from a quick fit of it.

    Raises:
        UncorrectableFaultError: a gauge fault, or a zero shift that leaves too few records.
    """
    try:
        uncorrected = CorrectedFit(problem, problem, fit or fit_regularized(problem, QUICK))
        selected = _forward(uncorrected)
        if len(selected.rejected) > 1 or not selected.is_consistent:
            # Readings in inches resemble a machine that needs no calibration, with some gross errors.
            in_mm = refitted(uncorrected, ALL_IN_INCHES)
            if in_mm is not None and in_mm.is_consistent and (refused := _refused(uncorrected, in_mm)):
                raise refused
        readmitted = _readmitted(selected)
        return _only_proven(selected if readmitted is None else _forward(readmitted))
    except UncorrectableFaultError as refused:
        if (other := _other_minimum(problem, refused)) is None:
            raise
        return Selection(other, {})


def _forward(current: CorrectedFit) -> CorrectedFit:
    """Correct for the most likely hypothesis until nothing is significant, or too many were rejected.

    One that leaving records out cannot correct is no cause unless all that was found explains the records,
    or replaces the longer fit of them as they are.
    """
    start, refused = current, None
    while len(current.rejected) < LARGEST_REJECTED_SHARE * current.original.records:
        extended = None if current.is_reliable else _searched(current)
        if extended is None:
            if not current.fit.termination.converged:  # the quick fit was cut short
                current = current.fitted(current.original, current.problem, current.faults, COARSE)
            # The hypothesis of lowest cost that is confirmed.
            ranked = current.likely_hypotheses() if current.is_reliable else ()
            confirmed = (confirmed_by_refit(current, hypothesis) for hypothesis in ranked)
            extended = next(filter(None, confirmed), None)
        if extended is None:
            break
        current = extended
        refused = _refused(start, current)
        if refused is not None and current.is_reliable:
            raise refused
    if refused is None:
        return current
    as_they_are = start.fitted(start.original, start.problem, start.faults, COARSE)
    if current.replaces(as_they_are):
        raise refused
    return as_they_are


def confirmed_by_refit(current: CorrectedFit, hypothesis: FaultHypothesis) -> CorrectedFit | None:
    """The fit corrected for one more fault; None if it does not confirm that fault.

    Without gross errors the other records must determine the parameters. Without a gauge fault the fit
    must have a sufficient part of the first-order gain, and be a proof: it agrees with the noise, or is
    better by far.
    """
    is_outlier = isinstance(hypothesis, OutlierHypothesis)
    if is_outlier and not hypothesis.corrected(current.problem).is_determined:
        return None
    corrected = refitted(current, hypothesis)
    if corrected is None or not isinstance(hypothesis, GaugeFaultHypothesis):
        return corrected
    limit = current.fit.chi2 - CONFIRMED_SHARE * hypothesis.gain
    is_shown = corrected.misfit_beside(current) < current.misfit / SHOWN_DECREASE
    is_proof = is_shown and (corrected.is_consistent or corrected.is_better_by_far_than(current))
    return corrected if is_proof and corrected.fit.chi2 < limit else None


def refitted(current: CorrectedFit, hypothesis: FaultHypothesis) -> CorrectedFit | None:
    """The fit corrected for one more fault; None if the records contradict it, or too few could."""
    match hypothesis:
        case ZeroShiftHypothesis():
            # The records after the shift must agree with the others up to a constant.
            split = CorrectedFit.uncorrected(hypothesis.split(current.problem))
            if not split.is_reliable or not split.problem.is_overdetermined:
                return None
            if not split.is_consistent and not hypothesis.corrected(current.problem).is_determined:
                return None
            if not hypothesis.is_constant(split.fit.linear_model):
                return None
        case GaugeFaultHypothesis() if not current.problem.is_overdetermined:
            return None
    corrected = hypothesis.corrected(current.problem)
    return CorrectedFit.fitted(current.original, corrected, (*current.faults, hypothesis))


def _refused(current: CorrectedFit, extended: CorrectedFit) -> UncorrectableFaultError | None:
    """The first additional fault that cannot be corrected by leaving records out, if there is one."""
    left = current.problem
    for fault in extended.faults[len(current.faults) :]:
        left = fault.corrected(left)
        is_refused_shift = isinstance(fault, ZeroShiftHypothesis) and not left.is_determined
        if is_refused_shift or isinstance(fault, GaugeFaultHypothesis):
            return UncorrectableFaultError(fault, current, extended, left)
    return None


def _searched(current: CorrectedFit) -> CorrectedFit | None:
    """The first correction that settles the matter, or the best if it lowers the misfit by far."""
    best: CorrectedFit | None = None
    tried: set[FaultHypothesis] = set()
    for candidate in _candidates(current):
        if isinstance(candidate, CorrectedFit):
            trial: CorrectedFit | None = candidate
        else:
            trial = None if candidate in tried else refitted(current, candidate)
            tried.add(candidate)
        if trial is None:
            continue
        if trial.settles(current):
            return trial
        misfit = trial.misfit_beside(current)
        if trial.is_better_by_far_than(current) and (best is None or misfit < best.misfit_beside(current)):
            best = trial
    return best


def _candidates(current: CorrectedFit) -> Iterator[FaultHypothesis | CorrectedFit]:
    """What may be wrong, in the order above: hypotheses, and one fit without several records."""
    if 0 < current.lost <= LARGEST_REJECTED_SHARE * current.original.records:
        lost = set(current.problem.record_ids).difference(current.fit.problem.record_ids)
        yield OutlierHypothesis(gain=0.0, unknowns=0, records=tuple(sorted(lost)))
    likely = current.likely_hypotheses()
    yield from likely[:TRIED_FIRST]
    deleted = _greedy_deletion(current)
    yield deleted
    yield from replace(current, fit=deleted.fit).likely_hypotheses()[:TRIED_FIRST]
    yield from likely


def _greedy_deletion(start: CorrectedFit) -> CorrectedFit:
    """Leave out the records of the most likely hypothesis, one after another with a refit in between."""
    now, found = start, 0
    while found < LARGEST_REJECTED_SHARE * start.problem.records and not now.is_consistent:
        removing = (one for one in now.likely_hypotheses() if not isinstance(one, GaugeFaultHypothesis))
        trial = next(filter(None, (refitted(now, hypothesis) for hypothesis in removing)), None)
        if trial is None:
            break
        now, found = trial, found + 1
    return now


def _readmitted(selected: CorrectedFit) -> CorrectedFit | None:
    """The fit with the rejected records that agree with it; None if no record agrees, or it is unreliable.

    The fewer disagree, the more significantly a record has to.
    """
    tests = selected.deletion_tests()
    disagreeing = sum(not test.agrees() for test in tests.values())
    agreeing = {record for record, test in tests.items() if test.agrees(max(0, disagreeing - 1))}
    if not agreeing:
        return None
    faults = tuple(
        _only(fault, set(fault.records) - agreeing) if isinstance(fault, OutlierHypothesis) else fault
        for fault in selected.faults
    )
    readmitted = selected.only_for(faults)
    return readmitted if readmitted.is_reliable else None


def _only(fault: OutlierHypothesis, records: set[RecordId]) -> OutlierHypothesis:
    """The gross errors of some of the records alone."""
    return replace(fault, records=tuple(record for record in fault.records if record in records))


def _only_proven(selected: CorrectedFit) -> Selection:
    """The fit without only those records that are proven false by the rest, which grows meanwhile."""
    while (proven := _proven_faults(selected, tests := selected.deletion_tests())) != selected.faults:
        selected = selected.only_for(proven)
    return Selection(selected, tests)


def _proven_faults(
    selected: CorrectedFit, tests: Mapping[RecordId, DeletionTest]
) -> tuple[FaultHypothesis, ...]:
    """The faults of a fit that the rest of its records proves; ``tests`` are those of the left-out ones."""
    # Of the noise alone, as the statistics of the faults are: stated effects explain the rest, not them.
    rest = selected.fit.noise_test
    can_prove = selected.fit.problem.is_overdetermined
    records = {
        record: tests[record].significance if can_prove or tests[record].is_certain else 0.0
        for record in selected.rejected
    }
    significances = [*(shift.significance for shift in selected.zero_shifts), *records.values()]
    required = required_significance(rest, len(significances))
    if rest.probability > GOOD_AGREEMENT and max(significances, default=0.0) >= required:
        return selected.faults
    proven = {record for record, significance in records.items() if significance >= required}
    kept: list[FaultHypothesis] = []
    for fault in selected.faults:
        match fault:
            case OutlierHypothesis():
                part = _only(fault, proven)
                kept += [part] if part.records else []
            case ZeroShiftHypothesis() if fault.significance < required:
                continue
            case _:
                kept.append(fault)
    return tuple(kept)


def required_significance(rest: ChiSquareTest, faults: int) -> float:
    """How many critical values the statistic of a fault must reach beside the rest of the records.

    The more ``faults`` are chosen, the less it proves that the rest agrees.
    """
    if rest.probability > GOOD_AGREEMENT and faults == 1:
        return BESIDE_GOOD
    return BESIDE_AGREEING if rest.is_explained else BESIDE_DISAGREEING


def _other_minimum(problem: Problem, refused: UncorrectableFaultError) -> CorrectedFit | None:
    """A fit within the tolerances of all readings as they are, by a longer search or from other starts.

    It agrees with the noise, or beside it what remains with a gauge fault ``refused`` is no proof.
    """
    after = refused.after
    is_proof = after.is_consistent or not isinstance(refused.fault, GaugeFaultHypothesis)
    others = islice(restarts(problem), OTHER_STARTS if problem.records <= FEW_RECORDS else 0)
    for start in chain([(problem, COARSE)], zip(others, repeat(QUICK))):
        found = CorrectedFit.uncorrected(*start)
        explains = found.is_consistent or not (is_proof or after.is_better_by_far_than(found))
        if found.is_plausible and explains:
            return found
    return None
