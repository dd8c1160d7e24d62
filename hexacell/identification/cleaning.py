"""Fit, find what is wrong with some records, leave them out or refuse, fit again.

Left out is what concerns records of their own: gross errors, and all that was measured after a
gauge's zero slipped. Misread gauges are refused: their readings would have to be guessed, and
somebody has to look at the machine or at the file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification import sentences
from hexacell.identification.anomaly import Anomaly, FalseReadings, Kind
from hexacell.identification.causes import Cause, GrossErrors, Label, Slip, labelled, likeliest
from hexacell.identification.expansion import Expansion
from hexacell.identification.fit import IN_A_HURRY, Fit, fit, refit
from hexacell.identification.judgement import Judgement, judge, poses_at
from hexacell.identification.misreadings import ALL_IN_INCHES, Suspect
from hexacell.identification.problem import Problem
from hexacell.identification.refusals import equations, is_enough
from hexacell.identification.result import Outlier
from hexacell.identification.search import explains, led_astray, search

LARGEST_SHARE = 0.1
"""Of gross errors in all records: beyond it they are not single mistakes."""

CONFIRMED = 0.5
"""Of the gain expected to first order, what a new solution must show of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """A fit of the records that agree, and the others."""

    fit: Fit
    outliers: tuple[Outlier, ...]
    anomalies: tuple[Anomaly, ...]


def clean(problem: Problem) -> Cleaned:
    """Fit a problem, and again without what disagrees.

    Raises:
        FalseReadings: gauges were misread, or so much came after a slip that too little is left.
    """
    cleaning = _Cleaning(problem)
    cleaning.run()
    return cleaning.result()


def leave_alone(problem: Problem) -> Cleaned:
    """Fit a problem with all records that the solver can keep."""
    return Cleaned(fit(problem), (), ())


class _Cleaning:
    """What is left of the records, their fit, and what was found so far."""

    def __init__(self, problem: Problem) -> None:
        self.whole = problem
        self.remaining = problem
        self.fit = fit(problem, manner=IN_A_HURRY)
        self.gross: set[Label] = set()
        self.slips: list[Slip] = []

    def run(self) -> None:
        """Look for causes until none is left that chance does not explain as well."""
        while len(self.gross) < LARGEST_SHARE * self.whole.records:
            cause = self._cause()
            if cause is None:
                break
            self._remove(cause)
        if len(self.gross) > 1 or not explains(self.remaining, self.fit):
            self._refuse_inches()
        self._readmit()

    def _cause(self) -> Cause | None:
        if led_astray(self.remaining, self.fit):
            cause = search(self.remaining, self.fit)
            if cause is not None or not self._patiently():
                return cause
        expansion = Expansion.at_solution(self.fit)
        causes = likeliest(expansion, self.fit.goodness, found_before=len(self.gross))
        return next(filter(self._confirmed, causes), None)

    def _patiently(self) -> bool:
        """Whether a solution that was not reached in a hurry is reached with more patience."""
        if not self.fit.solution.termination.converged:
            self.fit = fit(self.remaining)
        return not led_astray(self.remaining, self.fit)

    def _refuse_inches(self) -> None:
        """Readings in inches resemble a machine that needs no calibration, with some gross errors."""
        suspect = Suspect(ALL_IN_INCHES, None, 0.0)
        in_mm = suspect.undone(self.whole)
        if explains(in_mm, fit(in_mm, manner=IN_A_HURRY)):
            self.remaining, self.fit = self.whole, fit(self.whole, manner=IN_A_HURRY)
            self._remove(suspect)

    def _confirmed(self, cause: Cause) -> bool:
        """A record can always be left out if enough are left; a misreading needs a second solution."""
        if isinstance(cause, GrossErrors):
            return is_enough(cause.undone(self.remaining))
        if isinstance(cause, Slip):
            return True
        trial = fit(cause.undone(self.remaining), manner=IN_A_HURRY)
        return trial.goodness.chi2 < self.fit.goodness.chi2 - CONFIRMED * cause.gain

    def _remove(self, cause: Cause) -> None:
        remaining = cause.undone(self.remaining)
        if isinstance(cause, Suspect):
            raise FalseReadings(
                sentences.of_misreading(
                    cause, self.fit.goodness, fit(remaining, manner=IN_A_HURRY).goodness
                )
            )
        if isinstance(cause, Slip):
            if not is_enough(remaining):
                raise FalseReadings(sentences.of_slip_refused(cause, equations(remaining)))
            self.slips.append(cause)
        else:
            self.gross.update(cause.labels)
        self.remaining, self.fit = remaining, fit(remaining, manner=IN_A_HURRY)

    def _readmit(self) -> None:
        """Take back what was left out too hastily, from the solution on."""
        if not self._left_out_singly():
            return
        agreeing = {label for label, judgement in self._judgements().items() if judgement.agrees}
        if not agreeing:
            return
        kept = {(point, orientation) for point, orientation in self.fit.problem.labels.tolist()}
        wanted = self.whole.keeping(labelled(self.whole, kept | agreeing))
        poses, reached = poses_at(wanted, self.fit)
        again = refit(
            replace(wanted, startable=np.ones(wanted.records, bool)), self.fit.solution.free, poses
        )
        if reached.all() and not led_astray(wanted, again) and not self._wrong_again(again):
            self.gross -= agreeing
            self.fit = again

    def _wrong_again(self, again: Fit) -> bool:
        return bool(likeliest(Expansion.at_solution(again), again.goodness, found_before=len(self.gross)))

    def _left_out_singly(self) -> list[Label]:
        """Gross errors, and records that the solver lost; those after a slip stay where they are."""
        slipped = {label for slip in self.slips for label in self._labels_after(slip)}
        kept = {(point, orientation) for point, orientation in self.fit.problem.labels.tolist()}
        labels = [(point, orientation) for point, orientation in self.whole.labels.tolist()]
        return [label for label in labels if label not in kept and label not in slipped]

    def _labels_after(self, slip: Slip) -> list[Label]:
        return [
            (point, orientation) for point, orientation in self.whole.labels[slip.rows(self.whole)].tolist()
        ]

    def _judgements(self) -> dict[Label, Judgement]:
        found = len(self.gross)
        return {
            label: judge(self.whole, label, self.fit, found_before=found)
            for label in self._left_out_singly()
        }

    def result(self) -> Cleaned:
        """The records left out, each with its reason."""
        judgements = self._judgements()
        outliers = [_outlier(label, judgement) for label, judgement in judgements.items()]
        anomalies = [sentences.of_record(outlier) for outlier in outliers]
        for slip in self.slips:
            labels = self._labels_after(slip)
            outliers += [Outlier(*label, float(slip.gain), Kind.SLIPPED_ZERO) for label in labels]
            anomalies.append(sentences.of_slip(slip, labels))
        return Cleaned(self.fit, tuple(outliers), tuple(anomalies))


def _outlier(label: Label, judgement: Judgement) -> Outlier:
    off = judgement.off
    off_mm = None if off is None else (float(off[0]), float(off[1]), float(off[2]))
    return Outlier(*label, judgement.statistic, judgement.kind, judgement.gauges, off_mm)
