"""The cause of residuals so large that the solution itself was led astray.

Around a wrong solution first-order tests say little. The drawing is a better place to ask: it is
millimetres from the truth, whatever the gauges show. The likeliest causes from both are tried one
after another, each by a whole new solution that owes nothing to the false readings.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, zip_longest

import numpy as np
from scipy.special import chdtri

from hexacell.identification import model
from hexacell.identification.causes import Cause, GrossErrors, likeliest
from hexacell.identification.expansion import Expansion
from hexacell.identification.fit import IN_A_HURRY, Fit, fit
from hexacell.identification.goodness import Agreement, Goodness
from hexacell.identification.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.judgement import poses_at
from hexacell.identification.misreadings import Suspect, suspects
from hexacell.identification.outliers import RecordTests
from hexacell.identification.problem import Problem
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are to the point."""

TRIED_FROM_EACH = 3
CLEAR_FALL = 20.0
"""Of the ratio of chi-square to its mean, by which a misreading is believed though more is wrong."""

SLIGHT_FALL = 1.5
TRIMMED_SHARE = 0.25
SURPRISING = float(chdtri(3, 1e-4))


def led_astray(problem: Problem, found: Fit) -> bool:
    """Whether a solution is too bad to ask it what is wrong."""
    lost = found.problem.records < problem.records
    converged = found.solution.termination.converged
    return lost or not converged or found.goodness.ratio > LARGEST_TRUSTED_RATIO


def explains(problem: Problem, found: Fit) -> bool:
    """Whether a fit agrees with the stated noise in all records."""
    return not led_astray(problem, found) and found.goodness.agreement is not Agreement.TOO_LARGE


def search(problem: Problem, found: Fit) -> Cause | None:
    """The cause that a fit without it confirms best; none if no cause does."""
    best: Cause | None = None
    least = _badness(problem, found)
    for cause in _shortlist(problem, found):
        without = cause.undone(problem)
        trial = fit(without, manner=IN_A_HURRY)
        if explains(without, trial):
            return cause
        fall = CLEAR_FALL if isinstance(cause, Suspect) else SLIGHT_FALL
        badness = _badness(without, trial)
        if badness * fall < _badness(problem, found) and badness < least:
            best, least = cause, badness
    return best


def _badness(problem: Problem, found: Fit) -> float:
    """The mean square residual; a record that could not be kept counts as very bad."""
    lost = problem.records - found.problem.records
    return found.goodness.ratio**2 + LARGEST_TRUSTED_RATIO**2 * lost


def _shortlist(problem: Problem, found: Fit) -> Iterator[Cause]:
    drawing = problem.mechanism.convention.free_part(problem.prior.centre)
    prior = np.linalg.inv(problem.prior.covariance)
    start = (problem.start, problem.startable)
    misread = _misreadings_around(problem, drawing, prior, start)
    lists = (
        misread,
        likeliest(Expansion.at_solution(found), found.goodness),
        _likeliest_around(problem, found.solution.free, found.held, poses_at(problem, found)),
    )
    first, *others = zip_longest(*(causes[:TRIED_FROM_EACH] for causes in lists))
    trimmed = _trimmed(problem, drawing, prior, start)
    everywhere = [suspect for suspect in misread if suspect.point is None]
    ordered = chain(first, trimmed, *others, everywhere)
    return _without_repetition(cause for cause in ordered if cause)


def _without_repetition(causes: Iterable[Cause]) -> Iterator[Cause]:
    tried = set()
    for cause in causes:
        if cause.key not in tried:
            tried.add(cause.key)
            yield cause


def _misreadings_around(
    problem: Problem, free: Array, held: Array, poses: tuple[Poses, Mask]
) -> list[Suspect]:
    expansion = _around(problem, free, held, poses)
    found = [] if expansion is None else suspects(expansion)
    return sorted(found, key=lambda suspect: -suspect.gain)


def _likeliest_around(problem: Problem, free: Array, held: Array, poses: tuple[Poses, Mask]) -> list[Cause]:
    expansion = _around(problem, free, held, poses)
    if expansion is None:
        return []
    return likeliest(expansion, Goodness(expansion.chi2, 3.0 * (problem.records - problem.points)))


def _around(problem: Problem, free: Array, held: Array, poses: tuple[Poses, Mask]) -> Expansion | None:
    """The expansion in the records that stand clear of singularities at a geometry."""
    rows = np.flatnonzero(poses[1])
    prediction = model.predict(problem.keeping(poses[1]), free, poses[0][rows])
    rows = rows[prediction.amplification < LARGEST_AMPLIFICATION]
    if not len(rows):
        return None
    kept = np.zeros(problem.records, dtype=bool)
    kept[rows] = True
    some = problem.keeping(kept)
    return Expansion.around(some, model.predict(some, free, poses[0][rows]), held)


def _trimmed(
    problem: Problem, free: Array, held: Array, poses: tuple[Poses, Mask]
) -> Iterator[GrossErrors]:
    """All records at once that stand out around a geometry; rightly or not will be seen later."""
    kept = poses[1].copy()
    while True:
        expansion = _around(problem, free, held, (poses[0], kept))
        if expansion is None:
            return
        tests = RecordTests.of(expansion)
        worst = int(np.argmax(tests.in_any_direction))
        if tests.in_any_direction[worst] <= SURPRISING * tests.scale:
            break
        kept &= np.any(problem.labels != expansion.problem.labels[worst], axis=1)
        if np.count_nonzero(~kept) > TRIMMED_SHARE * problem.records:
            return
    if not kept.all():
        left_out = tuple((point, orientation) for point, orientation in problem.labels[~kept].tolist())
        yield GrossErrors(left_out, 0.0, 0)
