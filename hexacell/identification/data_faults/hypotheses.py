"""What may have spoilt records: gross errors, a slipped zero, misread gauges; the likeliest first.

Gauges exchanged, reversed or reading in inches, at one point or at all of them.
# MERGED-DOC
A misreading is a known matrix T: the readings were d where they should have been T d. Were it so,
the residuals P - d would be P - T d, which changes them by ``Z = -(T - 1) d`` in all records
concerned; and the chi-square by ``2 Z^T M r + Z^T M Z`` (see :mod:`.expansion`). No parameter is
estimated, so a fall of the chi-square is a likelihood ratio.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from hexacell.identification.data_faults.score_tests import (
    LinearizedModel,
    OutlierStatistics,
    ZeroShiftStatistics,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import GAUGES, DataFaultKind
from hexacell.kinematics.rotations import Array, Mask

MM_PER_INCH = 25.4


@dataclass(frozen=True, slots=True, eq=False)
class GaugeFault:
    """One way to misread gauges; ``remedy`` (3, 3) makes true readings of the false ones."""

    kind: DataFaultKind
    gauges: str
    remedy: Array


@dataclass(frozen=True, slots=True, eq=False)
class GaugeFaultHypothesis:
    """A misreading at one point, or at every point.

    Attributes:
        gain: by how much the chi-square would fall, to first order, were it undone.
    """

    misreading: GaugeFault
    point: int | None
    gain: float
    unknowns = 0

    @property
    def key(self) -> Hashable:
        """The same for the same cause, however it was found."""
        return self.misreading.kind, self.misreading.remedy.tobytes(), self.point

    def corrected(self, problem: Problem) -> Problem:
        """The problem with true readings."""
        rows = np.ones(problem.records, bool) if self.point is None else problem.labels[:, 0] == self.point
        return corrected(problem, self.misreading, rows)


def corrected(problem: Problem, misreading: GaugeFault, rows: Mask) -> Problem:
    """The problem with true readings in some records (n,)."""
    change = _in_base_frame(problem, misreading.remedy)
    deviations = np.where(rows[:, None], problem.deviations @ change.T, problem.deviations)
    return replace(problem, deviations=deviations)


def score_gauge_faults(expansion: LinearizedModel) -> list[GaugeFaultHypothesis]:
    """Every misreading at every point and at all of them, with what undoing it would gain."""
    problem = expansion.problem
    points = [int(problem.labels[row, 0]) for row in problem.first_rows]
    found = []
    for misreading in GAUGE_FAULTS:
        remedy = _in_base_frame(problem, misreading.remedy) - np.eye(3)
        at_points, everywhere = _gains(expansion, -problem.deviations @ remedy.T)
        found.append(GaugeFaultHypothesis(misreading, None, everywhere))
        pairs = zip(points, at_points.tolist(), strict=True)
        found += [GaugeFaultHypothesis(misreading, point, gain) for point, gain in pairs]
    return found


def _gains(expansion: LinearizedModel, change: Array) -> tuple[Array, float]:
    """The fall of the chi-square if residuals change by (n, 3), mm, at each point (m,), or in all."""
    problem, weights = expansion.problem, expansion.weights
    weighted = np.einsum("nij,nj->ni", weights, change)
    constants = np.linalg.solve(problem.group_sums(weights), problem.group_sums(weighted)[..., None])[
        ..., 0
    ]
    centred = change - problem.per_record(constants)
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


def _misreadings() -> Iterator[GaugeFault]:
    for first, second in ((0, 1), (0, 2), (1, 2)):
        order = [0, 1, 2]
        order[first], order[second] = second, first
        yield GaugeFault(DataFaultKind.EXCHANGED, GAUGES[first] + GAUGES[second], np.eye(3)[order])
    for order in ([1, 2, 0], [2, 0, 1]):
        yield GaugeFault(DataFaultKind.EXCHANGED, GAUGES, np.eye(3)[order])
    for kind, factor in ((DataFaultKind.REVERSED, -1.0), (DataFaultKind.INCHES, MM_PER_INCH)):
        for axis, gauge in enumerate(GAUGES):
            yield GaugeFault(kind, gauge, np.diag(np.where(np.arange(3) == axis, factor, 1.0)))
        yield GaugeFault(kind, GAUGES, factor * np.eye(3))


GAUGE_FAULTS = tuple(_misreadings())
ALL_IN_INCHES = GAUGE_FAULTS[-1]


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
class OutlierHypothesis:
    """Records, as point and orientation, that do not agree with all the others; to be left out."""

    labels: tuple[Label, ...]
    gain: float
    unknowns: int

    @property
    def key(self) -> Hashable:
        """The same for the same cause, however it was found."""
        return self.labels

    def corrected(self, problem: Problem) -> Problem:
        """The problem without these records."""
        return problem.subset(~record_mask(problem, self.labels))


@dataclass(frozen=True, slots=True, eq=False)
class ZeroShiftHypothesis:
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
        first = np.flatnonzero(record_mask(problem, [(self.point, self.orientation)]))[0]
        after: Mask = (problem.labels[:, 0] == self.point) & (np.arange(problem.records) >= first)
        return after

    def corrected(self, problem: Problem) -> Problem:
        """The problem without the records after the slip."""
        return problem.subset(~self.rows(problem))

    def split_station(self, problem: Problem) -> Problem:
        """The problem with the records after the slip as a point of their own, its zero unknown too."""
        after = self.rows(problem)
        labels = problem.labels.copy()
        labels[after, 0] = NOBODYS_POINT
        first_rows = np.union1d(problem.first_rows, np.flatnonzero(after)[:1])
        return replace(problem, labels=labels, first_rows=first_rows)


FaultHypothesis = OutlierHypothesis | ZeroShiftHypothesis | GaugeFaultHypothesis


def record_ids(problem: Problem) -> list[Label]:
    """Point and orientation of each record."""
    return [(point, orientation) for point, orientation in problem.labels.tolist()]


def record_mask(problem: Problem, labels: Collection[Label]) -> Mask:
    """Which records (n,) of a problem bear one of some labels."""
    return np.array([label in labels for label in record_ids(problem)], dtype=bool)


def rank_hypotheses(
    expansion: LinearizedModel, goodness: ChiSquareTest, *, found_before: int = 0
) -> list[FaultHypothesis]:
    """The explanations of the residuals that chance does not explain as well, the likeliest first."""
    tests = OutlierStatistics.of(expansion)
    causes: list[FaultHypothesis] = [*_gross_error(expansion, tests, found_before)]
    if goodness.probability < WORTH_A_LOOK:
        causes += [*_slip(expansion, tests.scale), *_gauge_faults(expansion, goodness, tests.scale)]
    return sorted(causes, key=lambda cause: COST_OF_AN_UNKNOWN * cause.unknowns - cause.gain)


def _gross_error(
    expansion: LinearizedModel, tests: OutlierStatistics, found_before: int
) -> Iterator[OutlierHypothesis]:
    excess = tests.threshold_ratio(found_before)
    row = int(np.argmax(excess))
    if excess[row] <= 1.0:
        return
    point, orientation = expansion.problem.labels[row].tolist()
    along_one, in_all = float(tests.along_gauges[row].max()), float(tests.omnibus[row])
    one_is_enough = in_all - along_one < 2.0 * COST_OF_AN_UNKNOWN
    gain, unknowns = (along_one, 1) if one_is_enough else (in_all, 3)
    yield OutlierHypothesis(((point, orientation),), gain, unknowns)


def _slip(expansion: LinearizedModel, scale: float) -> Iterator[ZeroShiftHypothesis]:
    tests = ZeroShiftStatistics.of(expansion)
    if not len(tests.rows):
        return
    best = int(np.argmax(tests.gains))
    if tests.gains[best] / scale > chdtri(3, FALSE_SLIPS_PER_FILE / len(tests.rows)):
        point, orientation = expansion.problem.labels[tests.rows[best]].tolist()
        yield ZeroShiftHypothesis(point, orientation, tests.shifts[best], float(tests.gains[best]))


def _gauge_faults(
    expansion: LinearizedModel, goodness: ChiSquareTest, scale: float
) -> Iterator[GaugeFaultHypothesis]:
    for suspect in score_gauge_faults(expansion):
        left = max(1.0, (goodness.chi2 - suspect.gain) / goodness.expected)
        if suspect.gain > LEAST_GAIN * min(scale, left):
            yield suspect
