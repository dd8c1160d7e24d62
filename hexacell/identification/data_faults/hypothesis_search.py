"""The search for data faults where the fit itself is wrong: each candidate is tried by a refit.

First-order tests around a wrong solution are unreliable. The drawing is a better expansion point: it is
within millimetres of the truth, whatever the gauges read. The most likely hypotheses of three lists
are tried in turn: gauge faults around the drawing, all kinds around the solution, and all kinds
around the solution with the records that the solver left out. Two candidates reject several records
at once: greedy deletion with a refit after each, and deletion around the drawing. The fit without the
deleted records is one more place to look for gauge faults that they have in common. The first corrected fit
that agrees with the noise, or nearly so and is incomparably better, is taken, else the best one if it is
better by far.

Source: Atkinson and Riani, Robust Diagnostic Regression Analysis, 2000, on masking: several outliers
hide each other around a fit to all of them, and show around one that they did not influence.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.fault_model import CorrectedFit, FaultHypothesis
from hexacell.identification.data_faults.hypotheses import (
    GaugeFaultHypothesis,
    OutlierHypothesis,
    rank_hypotheses,
    record_ids,
    score_gauge_faults,
)
from hexacell.identification.data_faults.score_tests import OutlierStatistics
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linearized_model import LinearizedModel
from hexacell.kinematics.rotations import Array, Mask

LARGEST_REJECTED_SHARE = 0.1
"""Of all records: if more disagree, they are not single mistakes."""

TRIED_FROM_EACH_LIST = 3
LARGEST_TRIMMED_SHARE = 0.25
SIGNIFICANCE = 1e-4


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
    model = LinearizedModel.at_solution(current.fit)
    return rank_hypotheses(model, current.fit.noise_test, found_before=found_before)


def _trials(current: CorrectedFit) -> Iterator[CorrectedFit]:
    start = _ExpansionPoint.start(current.problem)
    gauge_faults = start.gauge_faults()
    elsewhere = _ExpansionPoint.solution(current).hypotheses()
    ranks = _by_rank(gauge_faults, hypotheses_at_solution(current, 0), elsewhere)
    tried: set[FaultHypothesis] = set()
    yield from _one_by_one(current, chain(*ranks[:1]), tried)
    deleted = _greedy_deletion(current)
    yield deleted
    yield from _one_by_one(current, [start.gross_errors()], tried)
    at_all_points = (hypothesis for hypothesis in gauge_faults if hypothesis.point is None)
    without_deleted = _ExpansionPoint.solution(replace(deleted, problem=current.problem)).gauge_faults()
    last = chain(without_deleted[:TRIED_FROM_EACH_LIST], *ranks[1:], at_all_points)
    yield from _one_by_one(current, last, tried)


def _by_rank(*lists: Sequence[FaultHypothesis]) -> list[tuple[FaultHypothesis | None, ...]]:
    """The most likely hypothesis of each list, the second of each, and so on."""
    return [*zip_longest(*(hypotheses[:TRIED_FROM_EACH_LIST] for hypotheses in lists))]


def _one_by_one(
    current: CorrectedFit, hypotheses: Iterable[FaultHypothesis | None], tried: set[FaultHypothesis]
) -> Iterator[CorrectedFit]:
    for hypothesis in hypotheses:
        if hypothesis is None or hypothesis in tried:
            continue
        tried.add(hypothesis)
        trial = hypothesis.trial(current)
        if trial is not None:
            yield trial


def _greedy_deletion(start: CorrectedFit) -> CorrectedFit:
    """Records left out by the most likely hypothesis, one after another with a refit in between."""
    now, found = start, 0
    while found < LARGEST_REJECTED_SHARE * start.problem.records and not now.is_consistent:
        removable = (
            hypothesis
            for hypothesis in hypotheses_at_solution(now, found)
            if not isinstance(hypothesis, GaugeFaultHypothesis)
        )
        trials = (hypothesis.trial(now) for hypothesis in removable)
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
    def solution(cls, current: CorrectedFit) -> _ExpansionPoint:
        """The solution, with the records that the solver left out."""
        problem, free = current.problem, current.fit.free
        solved = problem.solve_poses(free)
        return cls(problem.starting_at(free, solved.poses, solved.found), current.fit.active_prior)

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
                records = tuple(record_ids(self.problem.subset(~kept)))
                return OutlierHypothesis(gain=0.0, unknowns=0, records=records) if records else None
            kept &= np.any(self.problem.labels != worst, axis=1)
        return None

    def _worst(self, kept: Mask) -> Array | None:
        """The label (2,) of the record with the largest statistic; none if it is not significant."""
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
        prediction = measurement_model.predict(some, some.initial_parameters, some.start)
        if prediction.singular.all():
            return None
        if prediction.singular.any():
            some = some.subset(~prediction.singular)
            prediction = measurement_model.predict(some, some.initial_parameters, some.start)
        return LinearizedModel.around(some, prediction, self.active_prior)
