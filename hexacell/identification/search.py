"""What made the residuals so large that the solution itself was led astray.

Around a wrong solution first-order tests say little. The drawing is a better place to ask: it is
millimetres from the truth, whatever the gauges show. The likeliest explanations from both are tried
one after another, each by a whole new solution that owes nothing to the false readings.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, zip_longest

import numpy as np

from hexacell.identification.causes import NOBODYS_POINT, Cause, Slip, likeliest
from hexacell.identification.elsewhere import Place
from hexacell.identification.expansion import Expansion
from hexacell.identification.fit import IN_A_HURRY, Fit, fit
from hexacell.identification.goodness import Agreement
from hexacell.identification.misreadings import Suspect
from hexacell.identification.outliers import RecordTests
from hexacell.identification.problem import Problem

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are to the point."""

LARGEST_SHARE = 0.1
"""Of gross errors in all records: beyond it they are not single mistakes."""

TRIED_FROM_EACH = 3
CLEAR_FALL = 20.0
"""Of the mean square residual, by which an explanation is believed though more must be wrong."""

Explanation = tuple[Cause, ...]
"""Causes that act together."""


def led_astray(problem: Problem, found: Fit) -> bool:
    """Whether a solution is too bad to ask it what is wrong."""
    lost = found.problem.records < problem.records
    converged = found.solution.termination.converged
    return lost or not converged or found.goodness.ratio > LARGEST_TRUSTED_RATIO


def explains(problem: Problem, found: Fit) -> bool:
    """Whether a fit agrees with the stated noise in all records."""
    return not led_astray(problem, found) and found.goodness.agreement is not Agreement.TOO_LARGE


def is_constant(problem: Problem, slip: Slip) -> bool:
    """Whether the records after a slip agree with all the others but for a constant."""
    parted = slip.parted(problem)
    found = fit(parted, manner=IN_A_HURRY)
    if led_astray(parted, found):
        return False
    concerned = np.isin(found.problem.labels[:, 0], [slip.point, NOBODYS_POINT])
    excess = RecordTests.of(Expansion.at_solution(found)).excess()
    return bool((excess[concerned] <= 1.0).all())


def search(problem: Problem, found: Fit) -> Explanation:
    """The explanation that a fit without it confirms best; empty if none does."""
    best: Explanation = ()
    least = _badness(problem, found) / CLEAR_FALL
    for trial in _trials(problem, found):
        if explains(trial.problem, trial.fit):
            return trial.explanation
        badness = _badness(trial.problem, trial.fit)
        if badness < least:
            best, least = trial.explanation, badness
    return best


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """An explanation, what is left when its causes are undone, and the fit of that."""

    explanation: Explanation
    problem: Problem
    fit: Fit


def _badness(problem: Problem, found: Fit) -> float:
    """The mean square residual; a record that could not be kept counts as very bad."""
    lost = problem.records - found.problem.records
    return found.goodness.ratio**2 + LARGEST_TRUSTED_RATIO**2 * lost


def _trials(problem: Problem, found: Fit) -> Iterator[_Trial]:
    beginning, here = Place.beginning(problem), Place.solution(problem, found)
    misread = beginning.misreadings()
    lists = (misread, likeliest(Expansion.at_solution(found), found.goodness), here.likeliest())
    first, *others = zip_longest(*(causes[:TRIED_FROM_EACH] for causes in lists))
    everywhere = (suspect for suspect in misread if suspect.point is None)
    tried: set[object] = set()
    yield from _one_by_one(problem, first, tried)
    yield _removed_in_turn(problem, found)
    yield from _one_by_one(problem, [beginning.gross_errors()], tried)
    yield from _one_by_one(problem, chain(*others, everywhere), tried)


def _one_by_one(problem: Problem, causes: Iterable[Cause | None], tried: set[object]) -> Iterator[_Trial]:
    for cause in causes:
        if cause is None or cause.key in tried:
            continue
        tried.add(cause.key)
        if isinstance(cause, Slip) and not is_constant(problem, cause):
            continue
        without = cause.undone(problem)
        yield _Trial((cause,), without, fit(without, manner=IN_A_HURRY))


def _removed_in_turn(problem: Problem, found: Fit) -> _Trial:
    """What disagrees most is left out, then what disagrees most with the fit of the others, and so on."""
    causes: Explanation = ()
    left, now = problem, found
    while len(causes) < LARGEST_SHARE * problem.records and not explains(left, now):
        suspected = likeliest(Expansion.at_solution(now), now.goodness, found_before=len(causes))
        removable = (cause for cause in suspected if not isinstance(cause, Suspect))
        cause = next((c for c in removable if not isinstance(c, Slip) or is_constant(left, c)), None)
        if cause is None:
            break
        causes, left = (*causes, cause), cause.undone(left)
        now = fit(left, manner=IN_A_HURRY)
    return _Trial(causes, left, now)
