"""The search for data faults where the fit itself is wrong: each candidate is tried by a refit.

First-order tests around a wrong solution are unreliable. The drawing is a better expansion point: it is
within millimetres of the truth, whatever the gauges read. The candidates, in the order in which they are
tried (:func:`_candidates`):

1. the most likely gauge fault around the drawing, and the most likely hypotheses of all kinds around the
   solution, and around the solution with the records that the solver left out;
2. greedy deletion: the most likely fault is left out, with a refit after each (:func:`_greedy_deletion`);
3. deletion around the drawing: all outliers there at once;
4. gauge faults around the fit without the deleted records, which they may have in common;
5. the second and third of the lists of 1, and every gauge fault at all points.

The first corrected fit that agrees with the noise, or nearly so and is incomparably better, is taken,
else the best one if it is better by far.

Source: Atkinson and Riani, Robust Diagnostic Regression Analysis, 2000, on masking: several outliers hide
each other around a fit to all of them, and show around one that they did not influence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, zip_longest

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.hypotheses import (
    SPLIT_POINT,
    CorrectedFit,
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
from hexacell.identification.problem.data_requirements import is_determined, is_overdetermined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array, Mask

LARGEST_REJECTED_SHARE = 0.1
"""Share of all records above which those that disagree are not single mistakes."""

TRIED_FROM_EACH_LIST = 3

LARGEST_TRIMMED_SHARE = 0.25
"""Largest share of all records that may be outliers around the drawing."""

SIGNIFICANCE = 1e-4
"""Probability that a good record counts as an outlier around the drawing."""


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
        case GaugeFaultHypothesis() if not is_overdetermined(current.problem):
            return None
    return current.corrected_for(hypothesis)


def _is_constant(current: CorrectedFit, shift: ZeroShiftHypothesis) -> bool:
    """Whether the records after a shift of the zero agree with the others up to a constant."""
    split = CorrectedFit.uncorrected(shift.split(current.problem))
    if not split.is_reliable or not is_overdetermined(split.problem):
        return False
    if not split.is_consistent and not is_determined(shift.corrected(current.problem)):
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
