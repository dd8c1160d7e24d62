"""Fits corrected for data faults, and the search for faults by such fits where the fit itself is wrong.

First-order tests around a wrong solution are unreliable. The drawing is a better expansion point: it is
within millimetres of the truth, whatever the gauges read. The candidates, in the order in which they are
tried (:func:`_candidates`):

1. the most likely gauge fault around the drawing, and the most likely hypotheses of all kinds around the
   solution, and around the solution with the records that the solver left out;
2. greedy deletion: the most likely fault is left out, with a refit after each (:func:`_greedy_deletion`);
3. deletion around the drawing: all outliers there at once;
4. gauge faults around the fit without the deleted records, which they may have in common;
5. the second and third of the lists of 1, and every gauge fault at all points.

Source: Atkinson and Riani, Robust Diagnostic Regression Analysis, 2000, on masking: several outliers hide
each other around a fit to all of them, and show around one that they did not influence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.hypotheses import (
    SPLIT_POINT,
    FaultHypothesis,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
)
from hexacell.identification.data_faults.score_tests import (
    OutlierStatistics,
    rank_hypotheses,
    score_gauge_faults,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.fit import QUICK, fit_regularized
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import RecordId

SUFFICIENT_DECREASE = 20.0
"""Factor of the mean square residual for a hypothesis to count although the fit is not yet consistent."""

SETTLING_DECREASE = 400.0
SETTLING_MISFIT = 4.0
"""Factor and largest mean square residual for a hypothesis to need no comparison with others."""

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are valid."""

LARGEST_REJECTED_SHARE = 0.1
"""Share of all records above which those that disagree are not single mistakes."""

TRIED_FROM_EACH_LIST = 3

LARGEST_TRIMMED_SHARE = 0.25
"""Largest share of all records that may be outliers around the drawing."""

SIGNIFICANCE = 1e-4
"""Probability that a good record counts as an outlier around the drawing."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedFit:
    """A fit of records that are corrected for data faults.

    Attributes:
        original: all records as measured.
        problem: the records after correction.
        fit: of those; the solver may have left out some of them, next to a singularity.
        faults: what was corrected, in the order of selection.
    """

    original: Problem
    problem: Problem
    fit: Identification
    faults: tuple[FaultHypothesis, ...] = ()

    @classmethod
    def uncorrected(cls, problem: Problem) -> CorrectedFit:
        """The fit of all records as measured."""
        return cls(problem, problem, fit_regularized(problem, QUICK))

    def corrected_for(self, hypothesis: FaultHypothesis) -> CorrectedFit:
        """The fit after correction for one more fault."""
        problem = hypothesis.corrected(self.problem)
        fit = fit_regularized(problem, QUICK)
        return replace(self, problem=problem, fit=fit, faults=(*self.faults, hypothesis))

    def converged(self) -> CorrectedFit:
        """The fit with the solver's full number of iterations, where the quick fit was cut short."""
        if self.fit.converged:
            return self
        return replace(self, fit=fit_regularized(self.problem))

    @property
    def rejected(self) -> list[RecordId]:
        """The records rejected for gross errors."""
        outliers = (fault for fault in self.faults if isinstance(fault, OutlierHypothesis))
        return [record for outlier in outliers for record in outlier.records]

    @property
    def zero_shifts(self) -> list[ZeroShiftHypothesis]:
        """The shifts of the gauges' zero that were corrected."""
        return [fault for fault in self.faults if isinstance(fault, ZeroShiftHypothesis)]

    def after(self, shift: ZeroShiftHypothesis) -> list[RecordId]:
        """All records after a shift of the zero."""
        return self.original.subset(shift.rows(self.original)).record_ids

    @property
    def lost(self) -> int:
        """How many records the solver left out."""
        return self.problem.records - self.fit.records

    @property
    def is_reliable(self) -> bool:
        """Whether the solution is good enough for first-order tests around it."""
        is_near = self.fit.goodness.ratio <= LARGEST_TRUSTED_RATIO
        return not self.lost and self.fit.converged and is_near

    @property
    def is_consistent(self) -> bool:
        """Whether all records agree with the stated noise."""
        return self.is_reliable and self.fit.goodness.agreement is not ChiSquareVerdict.TOO_LARGE

    @property
    def misfit(self) -> float:
        """The mean square residual; a lost record counts as one at the largest trusted ratio."""
        squares = self.fit.goodness.ratio**2 * self.fit.records + LARGEST_TRUSTED_RATIO**2 * self.lost
        return squares / self.problem.records

    def is_better_by_far_than(self, other: CorrectedFit) -> bool:
        """Whether it explains so much more that it is right although something else is still wrong."""
        return self.misfit < other.misfit / SUFFICIENT_DECREASE

    def settles(self, other: CorrectedFit) -> bool:
        """Whether no other hypothesis can explain it better: it agrees, or an imperfect machine is left."""
        is_near_noise = self.is_reliable and self.misfit <= SETTLING_MISFIT
        return self.is_consistent or (is_near_noise and self.misfit < other.misfit / SETTLING_DECREASE)


class UncorrectableFaultError(Exception):
    """A fault of the records that cannot be corrected by leaving some of them out.

    Attributes:
        before: the fit that does not explain it.
        after: the fit corrected for it.
        left: the records that are left without it.
    """

    def __init__(
        self, fault: FaultHypothesis, before: CorrectedFit, after: CorrectedFit, left: Problem
    ) -> None:
        super().__init__(fault)
        self.fault, self.before, self.after, self.left = fault, before, after, left


def search(current: CorrectedFit) -> CorrectedFit | None:
    """The first correction that settles the matter, or the best if it lowers the misfit by far."""
    best: CorrectedFit | None = None
    for trial in _trials(current):
        if trial.settles(current):
            return trial
        if trial.is_better_by_far_than(current) and (best is None or trial.misfit < best.misfit):
            best = trial
    return best


def hypotheses_at_solution(current: CorrectedFit, found_before: int) -> list[FaultHypothesis]:
    """The significant hypotheses by tests around the solution, the most likely first."""
    return rank_hypotheses(current.fit.linear_model, current.fit.noise_test, found_before=found_before)


def refitted(current: CorrectedFit, hypothesis: FaultHypothesis) -> CorrectedFit | None:
    """The fit corrected for one more fault; None if the records contradict it, or too few could."""
    match hypothesis:
        case ZeroShiftHypothesis() if not _is_constant(current, hypothesis):
            return None
        case GaugeFaultHypothesis() if not current.problem.is_overdetermined:
            return None
    return current.corrected_for(hypothesis)


def _is_constant(current: CorrectedFit, shift: ZeroShiftHypothesis) -> bool:
    """Whether the records after a shift of the zero agree with the others up to a constant."""
    split = CorrectedFit.uncorrected(shift.split(current.problem))
    if not split.is_reliable or not split.problem.is_overdetermined:
        return False
    if not split.is_consistent and not shift.corrected(current.problem).is_determined:
        return False
    concerned = np.isin(split.fit.problem.labels[:, 0], [shift.point, SPLIT_POINT])
    statistics = OutlierStatistics.of(split.fit.linear_model)
    return bool((statistics.threshold_ratio()[concerned] <= 1.0).all())


def _trials(current: CorrectedFit) -> Iterator[CorrectedFit]:
    """The corrected fits of all candidates, each hypothesis tried once."""
    tried: set[FaultHypothesis] = set()
    for candidate in _candidates(current):
        if isinstance(candidate, CorrectedFit):
            yield candidate
        elif candidate not in tried:
            tried.add(candidate)
            trial = refitted(current, candidate)
            if trial is not None:
                yield trial


def _candidates(current: CorrectedFit) -> Iterator[FaultHypothesis | CorrectedFit]:
    """What may be wrong, in the order above: hypotheses, and one fit without several records."""
    start = _ExpansionPoint.start(current.problem)
    gauge_faults = start.gauge_faults()
    elsewhere = _ExpansionPoint.solution(current, current.fit).hypotheses()
    lists = (gauge_faults, hypotheses_at_solution(current, 0), elsewhere)
    first, *others = [*zip_longest(*(one[:TRIED_FROM_EACH_LIST] for one in lists))] or [()]
    yield from filter(None, first)
    deleted = _greedy_deletion(current)
    yield deleted
    if (outliers := start.gross_errors()) is not None:
        yield outliers
    yield from _ExpansionPoint.solution(current, deleted.fit).gauge_faults()[:TRIED_FROM_EACH_LIST]
    yield from filter(None, chain(*others))
    yield from (hypothesis for hypothesis in gauge_faults if hypothesis.point is None)


def _greedy_deletion(start: CorrectedFit) -> CorrectedFit:
    """Leave out the records of the most likely hypothesis, one after another with a refit in between."""
    now, found = start, 0
    while found < LARGEST_REJECTED_SHARE * start.problem.records and not now.is_consistent:
        hypotheses = hypotheses_at_solution(now, found)
        removing = (one for one in hypotheses if not isinstance(one, GaugeFaultHypothesis))
        trials = (refitted(now, hypothesis) for hypothesis in removing)
        trial = next((trial for trial in trials if trial is not None), None)
        if trial is None:
            break
        now, found = trial, found + 1
    return now


@dataclass(frozen=True, slots=True, eq=False)
class _ExpansionPoint:
    """A geometry to linearize the model around: the one at which a problem starts.

    ``active_prior`` is the precision (p, p), 1/mm^2, of the prior there.
    """

    problem: Problem
    active_prior: Array

    @classmethod
    def start(cls, problem: Problem) -> _ExpansionPoint:
        """Where a fit starts, as a rule the drawing, with the full prior."""
        return cls(problem, problem.prior.precision)

    @classmethod
    def solution(cls, current: CorrectedFit, fit: Identification) -> _ExpansionPoint:
        """The solution of a fit, with all records of another one."""
        solved = current.problem.solve_poses(fit.free)
        return cls(current.problem.starting_at(fit.free, solved.poses, solved.found), fit.active_prior)

    def hypotheses(self) -> list[FaultHypothesis]:
        """The significant hypotheses, the most likely first."""
        model = self._model(self.problem.has_start_pose)
        if model is None:
            return []
        return rank_hypotheses(model, ChiSquareTest(model.chi2, model.problem.coordinates))

    def gauge_faults(self) -> list[GaugeFaultHypothesis]:
        """All gauge faults, the one with the largest gain first."""
        model = self._model(self.problem.has_start_pose)
        hypotheses = [] if model is None else score_gauge_faults(model)
        return sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)

    def gross_errors(self) -> OutlierHypothesis | None:
        """All outliers by deletion of the worst record, one after another, at the same geometry."""
        kept = self.problem.has_start_pose.copy()
        while np.count_nonzero(~kept) <= LARGEST_TRIMMED_SHARE * self.problem.records:
            worst = self._worst(kept)
            if worst is None:
                records = tuple(self.problem.subset(~kept).record_ids)
                return OutlierHypothesis(gain=0.0, unknowns=0, records=records) if records else None
            kept &= np.any(self.problem.labels != worst, axis=1)
        return None

    def _worst(self, kept: Mask) -> Array | None:
        """The label (2,) of the record with the largest statistic; None if it is not significant."""
        model = self._model(kept)
        if model is None:
            return None
        statistics = OutlierStatistics.of(model)
        worst = int(np.argmax(statistics.omnibus))
        is_significant = statistics.omnibus[worst] > chi_square_limit(3, SIGNIFICANCE) * statistics.scale
        return model.problem.labels[worst] if is_significant else None

    def _model(self, kept: Mask) -> LinearizedModel | None:
        """The linear model of those of some records (n,) that are not next to a singularity."""
        some = self.problem.subset(kept)
        prediction = predict(some, some.initial_parameters, some.start)
        if prediction.singular.all():
            return None
        if prediction.singular.any():
            some = some.subset(~prediction.singular)
            prediction = predict(some, some.initial_parameters, some.start)
        return LinearizedModel.around(some, prediction, self.active_prior)
