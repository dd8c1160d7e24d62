"""What made the residuals so large that the solution itself was led astray.

Around a wrong solution first-order tests say little. The drawing is a better place to ask: it is
millimetres from the truth, whatever the gauges show. The likeliest explanations from both are tried
one after another, each by a whole new solution that owes nothing to the false readings.

First-order tests around a geometry other than a solution: around the drawing, for one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, zip_longest

import numpy as np
from scipy.special import chdtri

from hexacell.identification.data_faults.hypotheses import (
    NOBODYS_POINT,
    FaultHypothesis,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
    rank_hypotheses,
    record_ids,
    score_gauge_faults,
)
from hexacell.identification.data_faults.record_test import poses_at
from hexacell.identification.data_faults.score_tests import LinearizedModel, OutlierStatistics
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.solver.regularized_fit import QUICK, Fit, fit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are to the point."""

LARGEST_SHARE = 0.1
"""Of gross errors in all records: beyond it they are not single mistakes."""

TRIED_FROM_EACH = 3
CLEAR_FALL = 20.0
"""Of the mean square residual, by which an explanation is believed though more must be wrong."""

FaultSet = tuple[FaultHypothesis, ...]
"""Causes that act together."""


def is_unreliable(problem: Problem, found: Fit) -> bool:
    """Whether a solution is too bad to ask it what is wrong."""
    lost = found.problem.records < problem.records
    converged = found.solution.termination.converged
    return lost or not converged or found.goodness.ratio > LARGEST_TRUSTED_RATIO


def is_consistent(problem: Problem, found: Fit) -> bool:
    """Whether a fit agrees with the stated noise in all records."""
    return not is_unreliable(problem, found) and found.goodness.agreement is not ChiSquareVerdict.TOO_LARGE


def is_pure_offset(problem: Problem, slip: ZeroShiftHypothesis) -> bool:
    """Whether the records after a slip agree with all the others but for a constant."""
    parted = slip.split_station(problem)
    found = fit(parted, manner=QUICK)
    if is_unreliable(parted, found):
        return False
    concerned = np.isin(found.problem.labels[:, 0], [slip.point, NOBODYS_POINT])
    excess = OutlierStatistics.of(LinearizedModel.at_solution(found)).threshold_ratio()
    return bool((excess[concerned] <= 1.0).all())


def search(problem: Problem, found: Fit) -> FaultSet:
    """The explanation that a fit without it confirms best; empty if none does."""
    best: FaultSet = ()
    least = _badness(problem, found) / CLEAR_FALL
    for trial in _trials(problem, found):
        if is_consistent(trial.problem, trial.fit):
            return trial.explanation
        badness = _badness(trial.problem, trial.fit)
        if badness < least:
            best, least = trial.explanation, badness
    return best


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """An explanation, what is left when its causes are undone, and the fit of that."""

    explanation: FaultSet
    problem: Problem
    fit: Fit


def _badness(problem: Problem, found: Fit) -> float:
    """The mean square residual; a record that could not be kept counts as very bad."""
    lost = problem.records - found.problem.records
    return found.goodness.ratio**2 + LARGEST_TRUSTED_RATIO**2 * lost


def _trials(problem: Problem, found: Fit) -> Iterator[_Trial]:
    beginning, here = ExpansionPoint.beginning(problem), ExpansionPoint.solution(problem, found)
    misread = beginning.misreadings()
    lists = (
        misread,
        rank_hypotheses(LinearizedModel.at_solution(found), found.goodness),
        here.rank_hypotheses(),
    )
    first, *others = zip_longest(*(causes[:TRIED_FROM_EACH] for causes in lists))
    everywhere = (suspect for suspect in misread if suspect.point is None)
    tried: set[object] = set()
    yield from _one_by_one(problem, first, tried)
    yield _removed_in_turn(problem, found)
    yield from _one_by_one(problem, [beginning.gross_errors()], tried)
    yield from _one_by_one(problem, chain(*others, everywhere), tried)


def _one_by_one(
    problem: Problem, causes: Iterable[FaultHypothesis | None], tried: set[object]
) -> Iterator[_Trial]:
    for cause in causes:
        if cause is None or cause.key in tried:
            continue
        tried.add(cause.key)
        if isinstance(cause, ZeroShiftHypothesis) and not is_pure_offset(problem, cause):
            continue
        without = cause.corrected(problem)
        yield _Trial((cause,), without, fit(without, manner=QUICK))


def _removed_in_turn(problem: Problem, found: Fit) -> _Trial:
    """What disagrees most is left out, then what disagrees most with the fit of the others, and so on."""
    causes: FaultSet = ()
    left, now = problem, found
    while len(causes) < LARGEST_SHARE * problem.records and not is_consistent(left, now):
        suspected = rank_hypotheses(
            LinearizedModel.at_solution(now), now.goodness, found_before=len(causes)
        )
        removable = (cause for cause in suspected if not isinstance(cause, GaugeFaultHypothesis))
        cause = next(
            (c for c in removable if not isinstance(c, ZeroShiftHypothesis) or is_pure_offset(left, c)),
            None,
        )
        if cause is None:
            break
        causes, left = (*causes, cause), cause.corrected(left)
        now = fit(left, manner=QUICK)
    return _Trial(causes, left, now)


TRIMMED_SHARE = 0.25
SURPRISING = float(chdtri(3, 1e-4))


@dataclass(frozen=True, slots=True, eq=False)
class ExpansionPoint:
    """A geometry to expand the model around.

    Attributes:
        free: its free parameters (p,), mm.
        active_prior: precision (p, p), 1/mm^2, of the prior there.
        poses: that close it, as far as they were ``found``.
    """

    problem: Problem
    free: Array
    active_prior: Array
    poses: PoseBatch
    found: Mask

    @classmethod
    def beginning(cls, problem: Problem) -> ExpansionPoint:
        """Where the search begins, as a rule the drawing, with the prior in full."""
        held = np.linalg.inv(problem.prior.covariance)
        return cls(problem, problem.initial_parameters, held, problem.start, problem.has_start_pose)

    @classmethod
    def solution(cls, problem: Problem, fit: Fit) -> ExpansionPoint:
        """A solution, at the records that it lost too."""
        poses, found = poses_at(problem, fit)
        return cls(problem, fit.solution.free, fit.active_prior, poses, found)

    def rank_hypotheses(self) -> list[FaultHypothesis]:
        """What may have spoilt the records, the likeliest first."""
        expansion = self._expansion(self.found)
        if expansion is None:
            return []
        problem = expansion.problem
        return rank_hypotheses(
            expansion, ChiSquareTest(expansion.chi2, 3.0 * (problem.records - problem.points))
        )

    def misreadings(self) -> list[GaugeFaultHypothesis]:
        """All misreadings, the one that would gain most first."""
        expansion = self._expansion(self.found)
        found = [] if expansion is None else score_gauge_faults(expansion)
        return sorted(found, key=lambda suspect: -suspect.gain)

    def gross_errors(self) -> OutlierHypothesis | None:
        """All records at once that stand out; whether rightly will be seen once they are left out."""
        kept = self.found.copy()
        while np.count_nonzero(~kept) <= TRIMMED_SHARE * self.problem.records:
            worst = self._worst(kept)
            if worst is None:
                left_out = record_ids(self.problem.subset(~kept))
                return OutlierHypothesis(tuple(left_out), 0.0, 0) if left_out else None
            kept &= np.any(self.problem.labels != worst, axis=1)
        return None

    def _worst(self, kept: Mask) -> Array | None:
        """The label (2,) of the record that stands out most; none if none does."""
        expansion = self._expansion(kept)
        if expansion is None:
            return None
        tests = OutlierStatistics.of(expansion)
        worst = int(np.argmax(tests.omnibus))
        stands_out = tests.omnibus[worst] > SURPRISING * tests.scale
        return expansion.problem.labels[worst] if stands_out else None

    def _expansion(self, kept: Mask) -> LinearizedModel | None:
        """The expansion in those of some records (n,) that stand clear of singularities."""
        rows = np.flatnonzero(kept)
        prediction = measurement_model.predict(self.problem.subset(kept), self.free, self.poses[rows])
        rows = rows[prediction.amplification < LARGEST_AMPLIFICATION]
        if not len(rows):
            return None
        clear = np.zeros_like(kept)
        clear[rows] = True
        some = self.problem.subset(clear)
        return LinearizedModel.around(
            some, measurement_model.predict(some, self.free, self.poses[rows]), self.active_prior
        )
