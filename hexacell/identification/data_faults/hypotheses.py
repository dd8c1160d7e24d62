"""Hypotheses on what is wrong with some records: what each changes, and how likely the records make it.

Score tests (:func:`rank_hypotheses`) need no second fit. An unknown b that adds ``Z b`` to the residuals r
of a linear model has the estimate and the gain, the decrease of the chi-square,

    b = (Z^T M Z)^-1 Z^T M r,    gain = r^T M Z b,

with M of :class:`.LinearizedModel`, of which only the blocks of the records concerned are needed. Z is

- one record, along one gauge or in any direction: a gross error;
- one constant for a record and all later ones of its point: a shift of the gauges' zero;
- a known change of the readings, with no unknown: a gauge fault (gauges exchanged, reversed or reading in
  inches). Readings d should have been T d with a matrix T, so that the residuals change by
  ``z = -(T - 1) d`` and the chi-square by ``2 z^T M r + z^T M z``.

Source: Rao, Proc. Cambridge Phil. Soc. 44, 1948 (score test).
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, zip_longest

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.outlier_statistics import OutlierStatistics, model_at
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.result import GAUGES, DataFaultKind, Identification
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import RecordId

PENALTY_PER_UNKNOWN = 10.0
"""How much a hypothesis must lower the chi-square for each number that it is free to choose."""

WORTH_TESTING = 0.05
"""Probability of the residuals below which zero shifts and gauge faults are tested too."""

FALSE_SHIFTS_PER_FILE = 1e-3

SMALLEST_GAUGE_FAULT_GAIN = 25.0
"""A likelihood ratio of 270,000, for some dozens of gauge faults tested."""

LONGEST_LIST = 3
"""Hypotheses around the drawing, and around a solution that is not trusted, that are worth a refit."""

MM_PER_INCH = 25.4

SPLIT_POINT = -1
"""Label of the point that the records after a zero shift form while it is tested."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultHypothesis(ABC):
    """One explanation of records that disagree with the others; equal however it was found.

    Attributes:
        gain: the decrease of the chi-square if it is true, to first order.
    """

    gain: float = field(compare=False)
    unknowns: int = field(compare=False)

    @property
    def cost(self) -> float:
        """The penalized gain, negative: the most likely hypothesis has the lowest cost."""
        return PENALTY_PER_UNKNOWN * self.unknowns - self.gain

    @abstractmethod
    def corrected(self, problem: Problem) -> Problem:
        """The problem without the fault: readings corrected, or records left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlierHypothesis(FaultHypothesis):
    """Gross errors: these records disagree with all the others and are left out."""

    records: tuple[RecordId, ...]

    def corrected(self, problem: Problem) -> Problem:
        """The problem without these records."""
        return problem.subset(~problem.mask_of(self.records))


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroShiftHypothesis(FaultHypothesis):
    """The gauges' zero shifted right before a record; it and the later ones of the point are left out.

    Attributes:
        shift: (3,), mm, by which the gauges x, y and z read too much since then.
        significance: the gain over its critical value, by the scatter that the records have.
    """

    point: int
    orientation: int
    shift: Array = field(compare=False)
    significance: float = field(compare=False)

    def rows(self, problem: Problem) -> Mask:
        """The records (n,) after the shift."""
        first = problem.record_ids.index((self.point, self.orientation))
        return np.asarray((problem.labels[:, 0] == self.point) & (np.arange(problem.records) >= first))

    def corrected(self, problem: Problem) -> Problem:
        """The problem without the records after the shift."""
        return problem.subset(~self.rows(problem))

    def split(self, problem: Problem) -> Problem:
        """The problem with the records after the shift as a point with an unknown zero of its own."""
        after = self.rows(problem)
        labels = problem.labels.copy()
        labels[after, 0] = SPLIT_POINT
        first_rows = np.union1d(problem.first_rows, np.flatnonzero(after)[:1])
        return replace(problem, labels=labels, first_rows=first_rows)

    def is_constant(self, split: LinearizedModel) -> bool:
        """Whether the records of the point, split at the shift, agree with the others up to a constant."""
        concerned = np.isin(split.problem.labels[:, 0], [self.point, SPLIT_POINT])
        return bool((OutlierStatistics.of(split).threshold_ratio()[concerned] <= 1.0).all())


@dataclass(frozen=True, slots=True, eq=False)
class GaugeFault:
    """A known fault of gauges; ``remedy`` (3, 3) turns false readings x, y, z into true ones."""

    kind: DataFaultKind
    gauges: str
    remedy: Array

    def in_base_frame(self, problem: Problem) -> Array:
        """The remedy (3, 3) of deviations along the axes of the base frame."""
        return np.asarray(problem.gauges @ self.remedy @ problem.gauges.T)


def _gauge_faults() -> Iterator[GaugeFault]:
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


GAUGE_FAULTS = tuple(_gauge_faults())


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeFaultHypothesis(FaultHypothesis):
    """A gauge fault at one point, or at every point (``point`` is None)."""

    gauge_fault: GaugeFault
    point: int | None

    def corrected(self, problem: Problem) -> Problem:
        """The problem with true readings."""
        rows = np.ones(problem.records, bool) if self.point is None else problem.labels[:, 0] == self.point
        remedy = self.gauge_fault.in_base_frame(problem)
        deviations = np.where(rows[:, None], problem.deviations @ remedy.T, problem.deviations)
        return replace(problem, deviations=deviations)


ALL_IN_INCHES = GaugeFaultHypothesis(gain=0.0, unknowns=0, gauge_fault=GAUGE_FAULTS[-1], point=None)


def rank_hypotheses(
    problem: Problem, fit: Identification, *, found_before: int = 0, is_trusted: bool = True
) -> list[FaultHypothesis]:
    """What may significantly be wrong with the records of a problem, the most likely first.

    The ``fit`` is of those that the solver could use, and so many gross errors were ``found_before``. Where
    tests around the solution are not to be trusted, the most likely gauge faults around the drawing come in
    turns with the hypotheses around the solution.
    """
    model, goodness = fit.linear_model, fit.noise_test
    around_drawing: list[GaugeFaultHypothesis] = []
    if not is_trusted:
        drawing = model_at(problem, problem.initial_parameters, problem.prior.precision)
        around_drawing = _rank_gauge_faults(drawing) if drawing else []
        # With the records that the solver left out, as far as they have poses at the solution.
        model = model_at(problem, fit.free, fit.active_prior) or model
        goodness = ChiSquareTest(model.chi2, model.problem.coordinates)
    statistics = OutlierStatistics.of(model)
    likely: list[FaultHypothesis] = [*_outlier(model, statistics, found_before)]
    if goodness.probability < WORTH_TESTING:
        for hypothesis in _rank_gauge_faults(model):
            remaining = max(1.0, (goodness.chi2 - hypothesis.gain) / goodness.expected)
            if hypothesis.gain > SMALLEST_GAUGE_FAULT_GAIN * min(statistics.scale, remaining):
                likely.append(hypothesis)
        likely += _zero_shift(model, statistics.scale)
    likely.sort(key=lambda hypothesis: hypothesis.cost)
    in_turns = zip_longest(around_drawing[:LONGEST_LIST], likely)
    at_all_points = (hypothesis for hypothesis in around_drawing if hypothesis.point is None)
    return [*filter(None, chain(*in_turns)), *at_all_points]


def _rank_gauge_faults(model: LinearizedModel) -> list[GaugeFaultHypothesis]:
    """Every gauge fault, at all points and at each, the one with the largest gain first."""
    problem = model.problem
    points = [None, *(int(problem.labels[row, 0]) for row in problem.first_rows)]
    hypotheses = []
    for fault in GAUGE_FAULTS:
        change = -problem.deviations @ (fault.in_base_frame(problem) - np.eye(3)).T
        at_points, at_all = _known_change_gains(model, change)
        hypotheses += [
            GaugeFaultHypothesis(gain=gain, unknowns=0, gauge_fault=fault, point=point)
            for point, gain in zip(points, [at_all, *at_points.tolist()], strict=True)
        ]
    return sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)


def _known_change_gains(model: LinearizedModel, change: Array) -> tuple[Array, float]:
    """The decrease of the chi-square if the residuals change by ``change`` (n, 3), mm.

    For the change at each point alone (m,), and at all of them together.
    """
    problem, weights = model.problem, model.weights
    weighted = np.einsum("nij,nj->ni", weights, change)
    constants = np.linalg.solve(problem.group_sums(weights), problem.group_sums(weighted)[..., None])
    centred = change - problem.per_record(constants[..., 0])
    score = problem.group_sums(np.sum(change * model.scores, axis=-1))
    squares = problem.group_sums(np.sum(centred * weighted, axis=-1))
    by_parameters = problem.group_sums(np.einsum("nip,ni->np", model.jacobian, weighted))
    taken = np.einsum("mp,pq,mq->m", by_parameters, model.covariance, by_parameters)
    total = by_parameters.sum(axis=0)
    all_squares = squares.sum() - total @ model.covariance @ total
    return -(2.0 * score + squares - taken), -float(2.0 * score.sum() + all_squares)


def _outlier(
    model: LinearizedModel, statistics: OutlierStatistics, found_before: int
) -> Iterator[OutlierHypothesis]:
    """The record with the most significant gross error, of one gauge or of any kind."""
    ratio = statistics.threshold_ratio(found_before)
    row = int(np.argmax(ratio))
    if ratio[row] <= 1.0:
        return
    point, orientation = model.problem.labels[row].tolist()
    one_gauge, any_direction = float(statistics.along_gauges[row].max()), float(statistics.omnibus[row])
    is_one_gauge = any_direction - one_gauge < 2.0 * PENALTY_PER_UNKNOWN
    gain, unknowns = (one_gauge, 1) if is_one_gauge else (any_direction, 3)
    yield OutlierHypothesis(gain=gain, unknowns=unknowns, records=((point, orientation),))


def _zero_shift(model: LinearizedModel, scale: float) -> Iterator[ZeroShiftHypothesis]:
    """The most significant shift of the gauges' zero right before a record.

    At least two records of the point must be before and after it: a single shifted record is a gross error.
    """
    problem, weights = model.problem, model.weights
    later = _sums_from(problem, np.ones(problem.records))
    before = problem.per_record(later[problem.first_rows]) - later
    rows = np.flatnonzero((before >= 2) & (later >= 2))
    if not len(rows):
        return
    score = _sums_from(problem, model.scores)[rows]
    weight = _sums_from(problem, weights)[rows]
    by_parameters = _sums_from(problem, weights @ model.jacobian)[rows]
    station = np.linalg.inv(problem.per_record(problem.group_sums(weights))[rows])
    taken = by_parameters @ model.covariance @ np.swapaxes(by_parameters, -1, -2)
    information = weight - weight @ station @ weight - taken
    changes = np.einsum("kij,kj->ki", np.linalg.pinv(information, hermitian=True), score)
    gains = np.sum(score * changes, axis=-1)  # about 3 where there is no shift
    best = int(np.argmax(gains))
    gain = float(gains[best])
    if (significance := gain / scale / chi_square_limit(3, FALSE_SHIFTS_PER_FILE / len(rows))) > 1.0:
        point, orientation = problem.labels[rows[best]].tolist()
        yield ZeroShiftHypothesis(
            gain=gain,
            unknowns=3,
            point=point,
            orientation=orientation,
            shift=-changes[best] @ problem.gauges,
            significance=significance,
        )


def _sums_from(problem: Problem, values: Array) -> Array:
    """Sums (n, ...) over each record and the later ones of its point."""
    before = np.cumsum(values, axis=0) - values
    in_point = before - problem.per_record(before[problem.first_rows])
    return np.asarray(problem.per_record(problem.group_sums(values)) - in_point)
