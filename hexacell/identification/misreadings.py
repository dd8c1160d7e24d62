"""Gauges exchanged, reversed or reading in inches, at one point or at all of them.

A misreading is a known matrix T: the readings were d where they should have been T d. Were it so,
the residuals P - d would be P - T d, which changes them by ``Z = -(T - 1) d`` in all records
concerned; and the chi-square by ``2 Z^T M r + Z^T M Z`` (see :mod:`.expansion`). No parameter is
estimated, so a fall of the chi-square is a likelihood ratio.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.anomaly import GAUGES, Kind
from hexacell.identification.expansion import Expansion
from hexacell.identification.problem import Problem
from hexacell.rotations import Array, Mask

MM_PER_INCH = 25.4


@dataclass(frozen=True, slots=True, eq=False)
class Misreading:
    """One way to misread gauges; ``remedy`` (3, 3) makes true readings of the false ones."""

    kind: Kind
    gauges: str
    remedy: Array


@dataclass(frozen=True, slots=True, eq=False)
class Suspect:
    """A misreading at one point, or at every point.

    Attributes:
        gain: by how much the chi-square would fall, to first order, were it undone.
    """

    misreading: Misreading
    point: int | None
    gain: float
    unknowns = 0

    @property
    def key(self) -> Hashable:
        """The same for the same cause, however it was found."""
        return self.misreading.kind, self.misreading.remedy.tobytes(), self.point

    def undone(self, problem: Problem) -> Problem:
        """The problem with true readings."""
        rows = np.ones(problem.records, bool) if self.point is None else problem.labels[:, 0] == self.point
        return undone(problem, self.misreading, rows)


def undone(problem: Problem, misreading: Misreading, rows: Mask) -> Problem:
    """The problem with true readings in some records (n,)."""
    change = _in_base_frame(problem, misreading.remedy)
    deviations = np.where(rows[:, None], problem.deviations @ change.T, problem.deviations)
    return replace(problem, deviations=deviations)


def suspects(expansion: Expansion) -> list[Suspect]:
    """Every misreading at every point and at all of them, with what undoing it would gain."""
    problem = expansion.problem
    points = [int(problem.labels[row, 0]) for row in problem.first_rows]
    found = []
    for misreading in MISREADINGS:
        remedy = _in_base_frame(problem, misreading.remedy) - np.eye(3)
        at_points, everywhere = _gains(expansion, -problem.deviations @ remedy.T)
        found.append(Suspect(misreading, None, everywhere))
        pairs = zip(points, at_points.tolist(), strict=True)
        found += [Suspect(misreading, point, gain) for point, gain in pairs]
    return found


def _gains(expansion: Expansion, change: Array) -> tuple[Array, float]:
    """The fall of the chi-square if residuals change by (n, 3), mm, at each point (m,), or in all."""
    problem, weights = expansion.problem, expansion.weights
    weighted = np.einsum("nij,nj->ni", weights, change)
    constants = np.linalg.solve(problem.group_sums(weights), problem.group_sums(weighted)[..., None])[
        ..., 0
    ]
    centred = change - problem.spread(constants)
    score = problem.group_sums(np.sum(change * expansion.scores, axis=-1))
    squares = problem.group_sums(np.sum(centred * weighted, axis=-1))
    by_parameters = problem.group_sums(np.einsum("nip,ni->np", expansion.jacobian, weighted))
    taken = np.einsum("mp,pq,mq->m", by_parameters, expansion.covariance, by_parameters)
    everywhere = by_parameters.sum(axis=0)
    total = squares.sum() - everywhere @ expansion.covariance @ everywhere
    return -(2.0 * score + squares - taken), -float(2.0 * score.sum() + total)


def _in_base_frame(problem: Problem, remedy: Array) -> Array:
    turned: Array = problem.gauges @ remedy @ problem.gauges.T
    return turned


def _misreadings() -> Iterator[Misreading]:
    for first, second in ((0, 1), (0, 2), (1, 2)):
        order = [0, 1, 2]
        order[first], order[second] = second, first
        yield Misreading(Kind.EXCHANGED, GAUGES[first] + GAUGES[second], np.eye(3)[order])
    for order in ([1, 2, 0], [2, 0, 1]):
        yield Misreading(Kind.EXCHANGED, GAUGES, np.eye(3)[order])
    for kind, factor in ((Kind.REVERSED, -1.0), (Kind.INCHES, MM_PER_INCH)):
        for axis, gauge in enumerate(GAUGES):
            yield Misreading(kind, gauge, np.diag(np.where(np.arange(3) == axis, factor, 1.0)))
        yield Misreading(kind, GAUGES, factor * np.eye(3))


MISREADINGS = tuple(_misreadings())
ALL_IN_INCHES = MISREADINGS[-1]
