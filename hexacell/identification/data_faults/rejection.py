"""Fit, find what is wrong with some records, leave them out or refuse, fit again.

Left out is what concerns records of their own: gross errors, and all that was measured after a
gauge's zero slipped. Misread gauges are refused: their readings would have to be guessed, and
somebody has to look at the machine or at the file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.hypotheses import (
    ALL_IN_INCHES,
    FaultHypothesis,
    GaugeFaultHypothesis,
    Label,
    OutlierHypothesis,
    ZeroShiftHypothesis,
    rank_hypotheses,
    record_ids,
    record_mask,
)
from hexacell.identification.data_faults.hypothesis_search import (
    LARGEST_SHARE,
    FaultSet,
    is_consistent,
    is_pure_offset,
    is_unreliable,
    search,
)
from hexacell.identification.data_faults.record_test import RecordVerdict, poses_at, test_record
from hexacell.identification.data_faults.score_tests import LinearizedModel
from hexacell.identification.problem.data_requirements import equations, is_determined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.multistart import start_points
from hexacell.identification.solver.regularized_fit import QUICK, Fit, fit, refit
from hexacell.identification.solver.result import DataFault, DataFaultKind, GaugeFaultError, Outlier
from hexacell.kinematics.rotations import Array

CONFIRMED = 0.5
"""Of the gain expected to first order, what a new solution must show of it."""

FEW_RECORDS = 60
ELSEWHERE = 4
WITHIN = 3.0
"""Before so few readings are called false, a search is begun at so many other robots; mean square of their
differences from the drawing, in sigma."""


@dataclass(frozen=True, slots=True, eq=False)
class ScreenedFit:
    """A fit of the records that agree, and the others."""

    fit: Fit
    outliers: tuple[Outlier, ...]
    anomalies: tuple[DataFault, ...]


def screen(problem: Problem) -> ScreenedFit:
    """Fit a problem, and again without what disagrees.

    Raises:
        FalseReadings: gauges were misread, or so much came after a slip that too little is left.
    """
    cleaning = _Cleaning(problem)
    try:
        cleaning.run()
    except GaugeFaultError:
        found = _begun_elsewhere(problem)
        if found is None:
            raise
        return ScreenedFit(found, (), ())
    return cleaning.result()


def fit_unscreened(problem: Problem) -> ScreenedFit:
    """Fit a problem with all records that the solver can keep."""
    return ScreenedFit(fit(problem), (), ())


def _begun_elsewhere(problem: Problem) -> Fit | None:
    """A robot within the tolerances that explains all readings as they are, if a search finds one.

    From the drawing a search may not: with few records the cost has other minima.
    """
    if problem.records > FEW_RECORDS:
        return None
    everywhere = np.ones(problem.records, dtype=bool)
    for free, poses in islice(start_points(problem), ELSEWHERE):
        begun = replace(problem, initial_parameters=free, start=poses, has_start_pose=everywhere)
        found = fit(begun, manner=QUICK)
        if is_consistent(problem, found) and _is_within(problem, found.solution.free):
            return found
    return None


def _is_within(problem: Problem, free: Array) -> bool:
    """Whether a robot is as near to the drawing as tolerances let some robots be."""
    moved = free - problem.mechanism.convention.free_parameters(problem.prior.centre)
    return bool(moved @ np.linalg.solve(problem.prior.covariance, moved) <= WITHIN * len(moved))


class _Cleaning:
    """What is left of the records, their fit, and what was found so far."""

    def __init__(self, problem: Problem) -> None:
        self.whole = problem
        self.remaining = problem
        self.fit = fit(problem, manner=QUICK)
        self.gross: set[Label] = set()
        self.slips: list[ZeroShiftHypothesis] = []

    def run(self) -> None:
        """Look for causes until none is left that chance does not explain as well."""
        self._remove_all()
        if len(self.gross) > 1 or not is_consistent(self.remaining, self.fit):
            self._refuse_inches()
        if self._left_out_singly() and self._readmit():
            self._remove_all()

    def _remove_all(self) -> None:
        while len(self.gross) < LARGEST_SHARE * self.whole.records:
            explanation = self._explanation()
            if not explanation:
                break
            self._remove(explanation)

    def _explanation(self) -> FaultSet:
        if is_unreliable(self.remaining, self.fit):
            found = search(self.remaining, self.fit)
            if found or not self._patiently():
                return found
        expansion = LinearizedModel.at_solution(self.fit)
        causes = rank_hypotheses(expansion, self.fit.goodness, found_before=len(self.gross))
        return tuple([*filter(self._confirmed, causes)][:1])

    def _patiently(self) -> bool:
        """Whether a solution that was not reached in a hurry is reached with more patience."""
        if not self.fit.solution.termination.converged:
            self.fit = fit(self.remaining)
        return not is_unreliable(self.remaining, self.fit)

    def _confirmed(self, cause: FaultHypothesis) -> bool:
        """A record can be left out if enough are left; what concerns more needs a second solution."""
        if isinstance(cause, OutlierHypothesis):
            return is_determined(cause.corrected(self.remaining))
        if isinstance(cause, ZeroShiftHypothesis):
            return is_pure_offset(self.remaining, cause)
        trial = fit(cause.corrected(self.remaining), manner=QUICK)
        return trial.goodness.chi2 < self.fit.goodness.chi2 - CONFIRMED * cause.gain

    def _refuse_inches(self) -> None:
        """Readings in inches resemble a machine that needs no calibration, with some gross errors."""
        suspect = GaugeFaultHypothesis(ALL_IN_INCHES, None, 0.0)
        in_mm = suspect.corrected(self.whole)
        if is_consistent(in_mm, fit(in_mm, manner=QUICK)):
            self.remaining, self.fit = self.whole, fit(self.whole, manner=QUICK)
            self._remove((suspect,))

    def _remove(self, explanation: FaultSet) -> None:
        for cause in explanation:
            self.remaining = cause.corrected(self.remaining)
            if isinstance(cause, GaugeFaultHypothesis):
                after = fit(self.remaining, manner=QUICK)
                raise GaugeFaultError(messages.of_misreading(cause, self.fit.goodness, after.goodness))
            if isinstance(cause, OutlierHypothesis):
                self.gross.update(cause.labels)
            elif is_determined(self.remaining):
                self.slips.append(cause)
            else:
                raise GaugeFaultError(messages.of_slip_refused(cause, equations(self.remaining)))
        self.fit = fit(self.remaining, manner=QUICK)

    def _readmit(self) -> bool:
        """Take back what was left out too hastily, from the solution on; whether there was anything."""
        agreeing = self._agreeing()
        if not agreeing:
            return False
        wanted = self.whole.subset(record_mask(self.whole, agreeing.union(record_ids(self.fit.problem))))
        poses, reached = poses_at(wanted, self.fit)
        if not reached.all():
            return False
        startable = replace(wanted, has_start_pose=reached)
        again = refit(startable, self.fit.solution.free, poses)
        if is_unreliable(wanted, again):
            return False
        self.gross -= agreeing
        self.remaining, self.fit = wanted, again
        return True

    def _agreeing(self) -> set[Label]:
        """Records that were left out and agree; the fewer disagree, the more must one do so to stay out."""
        sure = [judged for judged in self._judgements(0).values() if not judged.agrees]
        judgements = self._judgements(max(0, len(sure) - 1))
        return {label for label, judged in judgements.items() if judged.agrees}

    def _judgements(self, found_before: int) -> dict[Label, RecordVerdict]:
        return {
            label: test_record(self.whole, label, self.fit, found_before=found_before)
            for label in self._left_out_singly()
        }

    def _left_out_singly(self) -> list[Label]:
        """Gross errors, and records that the solver lost; those after a slip stay where they are."""
        if self.fit.problem.records == self.whole.records:
            return []
        accounted_for = {label for slip in self.slips for label in self._labels_after(slip)}
        accounted_for.update(record_ids(self.fit.problem))
        return [label for label in record_ids(self.whole) if label not in accounted_for]

    def _labels_after(self, slip: ZeroShiftHypothesis) -> list[Label]:
        return record_ids(self.whole.subset(slip.rows(self.whole)))

    def result(self) -> ScreenedFit:
        """The records left out, each with its reason."""
        judgements = self._judgements(0)
        outliers = [_outlier(label, judgement) for label, judgement in judgements.items()]
        anomalies = [messages.of_record(outlier) for outlier in outliers]
        for slip in self.slips:
            labels = self._labels_after(slip)
            outliers += [Outlier(*label, float(slip.gain), DataFaultKind.SLIPPED_ZERO) for label in labels]
            anomalies.append(messages.of_slip(slip, labels))
        return ScreenedFit(self.fit, tuple(outliers), tuple(anomalies))


def _outlier(label: Label, judgement: RecordVerdict) -> Outlier:
    off = judgement.off
    off_mm = None if off is None else (float(off[0]), float(off[1]), float(off[2]))
    return Outlier(*label, judgement.statistic, judgement.kind, judgement.gauges, off_mm, judgement.stray)
