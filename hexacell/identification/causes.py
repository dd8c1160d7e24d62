"""What may have spoilt records: gross errors, a slipped zero, misread gauges; the likeliest first."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from hexacell.identification.expansion import Expansion
from hexacell.identification.goodness import Goodness
from hexacell.identification.misreadings import Suspect, suspects
from hexacell.identification.outliers import RecordTests
from hexacell.identification.problem import Problem
from hexacell.identification.slips import SlipTests
from hexacell.rotations import Array, Mask

WORTH_A_LOOK = 0.05
"""Probability of the residuals from which down more is looked for than single gross errors."""

FALSE_SLIPS_PER_FILE = 1e-3
LEAST_GAIN = 25.0
"""Of a misreading that is believed: a likelihood ratio of 270,000, for some dozens tried."""

COST_OF_AN_UNKNOWN = 10.0
"""What an explanation must lower the chi-square by for each number that it is free to choose."""

NOBODYS_POINT = -1

Label = tuple[int, int]


@dataclass(frozen=True, slots=True)
class GrossErrors:
    """Records, as point and orientation, that do not agree with all the others; to be left out."""

    labels: tuple[Label, ...]
    gain: float
    unknowns: int

    @property
    def key(self) -> Hashable:
        """The same for the same cause, however it was found."""
        return self.labels

    def undone(self, problem: Problem) -> Problem:
        """The problem without these records."""
        return problem.keeping(~labelled(problem, self.labels))


@dataclass(frozen=True, slots=True, eq=False)
class Slip:
    """The gauges' zero slipped right before a record; it and the later ones of the point are useless.

    Attributes:
        shift: (3,), mm, what the gauges x, y and z show more since.
    """

    point: int
    orientation: int
    shift: Array
    gain: float
    unknowns = 3

    @property
    def key(self) -> Hashable:
        """The same for the same cause, however it was found."""
        return self.point, self.orientation

    def rows(self, problem: Problem) -> Mask:
        """The records (n,) after the slip."""
        first = np.flatnonzero(labelled(problem, [(self.point, self.orientation)]))[0]
        after: Mask = (problem.labels[:, 0] == self.point) & (np.arange(problem.records) >= first)
        return after

    def undone(self, problem: Problem) -> Problem:
        """The problem without the records after the slip."""
        return problem.keeping(~self.rows(problem))

    def parted(self, problem: Problem) -> Problem:
        """The problem with the records after the slip as a point of their own, its zero unknown too."""
        after = self.rows(problem)
        labels = problem.labels.copy()
        labels[after, 0] = NOBODYS_POINT
        first_rows = np.union1d(problem.first_rows, np.flatnonzero(after)[:1])
        return replace(problem, labels=labels, first_rows=first_rows)


Cause = GrossErrors | Slip | Suspect


def labels_of(problem: Problem) -> list[Label]:
    """Point and orientation of each record."""
    return [(point, orientation) for point, orientation in problem.labels.tolist()]


def labelled(problem: Problem, labels: Collection[Label]) -> Mask:
    """Which records (n,) of a problem bear one of some labels."""
    return np.array([label in labels for label in labels_of(problem)], dtype=bool)


def likeliest(expansion: Expansion, goodness: Goodness, *, found_before: int = 0) -> list[Cause]:
    """The explanations of the residuals that chance does not explain as well, the likeliest first."""
    tests = RecordTests.of(expansion)
    causes: list[Cause] = [*_gross_error(expansion, tests, found_before)]
    if goodness.probability < WORTH_A_LOOK:
        causes += [*_slip(expansion, tests.scale), *_misreadings(expansion, goodness, tests.scale)]
    return sorted(causes, key=lambda cause: COST_OF_AN_UNKNOWN * cause.unknowns - cause.gain)


def _gross_error(expansion: Expansion, tests: RecordTests, found_before: int) -> Iterator[GrossErrors]:
    excess = tests.excess(found_before)
    row = int(np.argmax(excess))
    if excess[row] <= 1.0:
        return
    point, orientation = expansion.problem.labels[row].tolist()
    along_one, in_all = float(tests.along_gauges[row].max()), float(tests.in_any_direction[row])
    one_is_enough = in_all - along_one < 2.0 * COST_OF_AN_UNKNOWN
    gain, unknowns = (along_one, 1) if one_is_enough else (in_all, 3)
    yield GrossErrors(((point, orientation),), gain, unknowns)


def _slip(expansion: Expansion, scale: float) -> Iterator[Slip]:
    tests = SlipTests.of(expansion)
    if not len(tests.rows):
        return
    best = int(np.argmax(tests.gains))
    if tests.gains[best] / scale > chdtri(3, FALSE_SLIPS_PER_FILE / len(tests.rows)):
        point, orientation = expansion.problem.labels[tests.rows[best]].tolist()
        yield Slip(point, orientation, tests.shifts[best], float(tests.gains[best]))


def _misreadings(expansion: Expansion, goodness: Goodness, scale: float) -> Iterator[Suspect]:
    for suspect in suspects(expansion):
        left = max(1.0, (goodness.chi2 - suspect.gain) / goodness.expected)
        if suspect.gain > LEAST_GAIN * min(scale, left):
            yield suspect
