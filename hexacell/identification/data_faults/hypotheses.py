"""The fault hypotheses: gross errors of records, a shift of the gauges' zero, gauge faults.

A gauge fault (:mod:`.gauge_faults`) may be at one point or at all of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.fault_model import (
    PENALTY_PER_UNKNOWN,
    CorrectedFit,
    FaultHypothesis,
)
from hexacell.identification.data_faults.gauge_faults import GAUGE_FAULTS, GaugeFault
from hexacell.identification.data_faults.score_tests import (
    OutlierStatistics,
    ZeroShiftStatistics,
    known_change_gains,
)
from hexacell.identification.problem.data_requirements import is_determined, is_overdetermined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linearized_model import LinearizedModel
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import RecordId

WORTH_TESTING = 0.05
"""Probability of the residuals below which zero shifts and gauge faults are tested too."""

FALSE_SHIFTS_PER_FILE = 1e-3
SMALLEST_GAUGE_FAULT_GAIN = 25.0
"""A likelihood ratio of 270,000, for some dozens of gauge faults tested."""

CONFIRMED_SHARE = 0.5
"""Of the first-order gain of a gauge fault, what a refit must confirm."""

SPLIT_POINT = -1
"""Label of the point that the records after a zero shift form while it is tested."""


def record_ids(problem: Problem) -> list[RecordId]:
    """Point and orientation of each record."""
    return [(point, orientation) for point, orientation in problem.labels.tolist()]


def record_mask(problem: Problem, records: Collection[RecordId]) -> Mask:
    """Which records (n,) of a problem are among some others."""
    return np.array([record in records for record in record_ids(problem)], dtype=bool)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlierHypothesis(FaultHypothesis):
    """Gross errors: these records disagree with all the others and are left out."""

    records: tuple[RecordId, ...]

    def of(self, records: Collection[RecordId]) -> OutlierHypothesis:
        """The same of other records."""
        return replace(self, records=tuple(records))

    def corrected(self, problem: Problem) -> Problem:
        """The problem without these records."""
        return problem.subset(~record_mask(problem, self.records))

    def confirmed(self, current: CorrectedFit) -> CorrectedFit | None:
        """The fit of the other records, if these determine the parameters."""
        return self.trial(current) if is_determined(self.corrected(current.problem)) else None


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
        first = np.flatnonzero(record_mask(problem, [(self.point, self.orientation)]))[0]
        after: Mask = (problem.labels[:, 0] == self.point) & (np.arange(problem.records) >= first)
        return after

    def corrected(self, problem: Problem) -> Problem:
        """The problem without the records after the shift."""
        return problem.subset(~self.rows(problem))

    def trial(self, current: CorrectedFit) -> CorrectedFit | None:
        """The fit without the records after the shift, if these agree with the others up to a constant."""
        split = CorrectedFit.uncorrected(self._split(current.problem))
        if not split.is_reliable or not is_overdetermined(split.problem):
            return None
        if not split.is_consistent and not is_determined(self.corrected(current.problem)):
            return None
        concerned = np.isin(split.fit.problem.labels[:, 0], [self.point, SPLIT_POINT])
        statistics = OutlierStatistics.of(LinearizedModel.at_solution(split.fit))
        is_constant = bool((statistics.threshold_ratio()[concerned] <= 1.0).all())
        return current.corrected_for(self) if is_constant else None

    def _split(self, problem: Problem) -> Problem:
        """The problem with the records after the shift as a point with an unknown zero of its own."""
        after = self.rows(problem)
        labels = problem.labels.copy()
        labels[after, 0] = SPLIT_POINT
        first_rows = np.union1d(problem.first_rows, np.flatnonzero(after)[:1])
        return replace(problem, labels=labels, first_rows=first_rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeFaultHypothesis(FaultHypothesis):
    """A gauge fault at one point, or at every point (``point`` is none)."""

    gauge_fault: GaugeFault
    point: int | None

    def corrected(self, problem: Problem) -> Problem:
        """The problem with true readings."""
        rows = np.ones(problem.records, bool) if self.point is None else problem.labels[:, 0] == self.point
        remedy = _in_base_frame(problem, self.gauge_fault)
        deviations = np.where(rows[:, None], problem.deviations @ remedy.T, problem.deviations)
        return replace(problem, deviations=deviations)

    def trial(self, current: CorrectedFit) -> CorrectedFit | None:
        """The fit with true readings, if there are equations to spare that could contradict them."""
        return current.corrected_for(self) if is_overdetermined(current.problem) else None

    def confirmed(self, current: CorrectedFit) -> CorrectedFit | None:
        """The fit with true readings, if it has a sufficient part of the first-order gain and is a proof.

        It is one if it agrees with the noise, or is better by far.
        """
        corrected = self.trial(current)
        if corrected is None:
            return None
        limit = current.fit.chi2 - CONFIRMED_SHARE * self.gain
        is_proof = corrected.is_consistent or corrected.is_better_by_far_than(current)
        return corrected if is_proof and corrected.fit.chi2 < limit else None


def _in_base_frame(problem: Problem, gauge_fault: GaugeFault) -> Array:
    turned: Array = problem.gauges @ gauge_fault.remedy @ problem.gauges.T
    return turned


ALL_IN_INCHES = GaugeFaultHypothesis(gain=0.0, unknowns=0, gauge_fault=GAUGE_FAULTS[-1], point=None)


def rank_hypotheses(
    model: LinearizedModel, goodness: ChiSquareTest, *, found_before: int = 0
) -> list[FaultHypothesis]:
    """The significant hypotheses on the residuals of a model, the most likely first."""
    statistics = OutlierStatistics.of(model)
    hypotheses: list[FaultHypothesis] = [*_outlier(model, statistics, found_before)]
    if goodness.probability < WORTH_TESTING:
        hypotheses += _zero_shift(model, statistics.scale)
        for hypothesis in score_gauge_faults(model):
            remaining = max(1.0, (goodness.chi2 - hypothesis.gain) / goodness.expected)
            if hypothesis.gain > SMALLEST_GAUGE_FAULT_GAIN * min(statistics.scale, remaining):
                hypotheses.append(hypothesis)
    return sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)


def score_gauge_faults(model: LinearizedModel) -> list[GaugeFaultHypothesis]:
    """Every gauge fault, at all points and at each, with its gain."""
    problem = model.problem
    points = [None, *(int(problem.labels[row, 0]) for row in problem.first_rows)]
    hypotheses = []
    for fault in GAUGE_FAULTS:
        change = -problem.deviations @ (_in_base_frame(problem, fault) - np.eye(3)).T
        at_points, at_all = known_change_gains(model, change)
        hypotheses += [
            GaugeFaultHypothesis(gain=gain, unknowns=0, gauge_fault=fault, point=point)
            for point, gain in zip(points, [at_all, *at_points.tolist()], strict=True)
        ]
    return hypotheses


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
    """The most significant shift of the gauges' zero."""
    statistics = ZeroShiftStatistics.of(model)
    if not len(statistics.rows):
        return
    best = int(np.argmax(statistics.gains))
    critical = chi_square_limit(3, FALSE_SHIFTS_PER_FILE / len(statistics.rows))
    gain = float(statistics.gains[best])
    if (significance := gain / scale / critical) > 1.0:
        point, orientation = model.problem.labels[statistics.rows[best]].tolist()
        yield ZeroShiftHypothesis(
            gain=gain,
            unknowns=3,
            point=point,
            orientation=orientation,
            shift=statistics.shifts[best],
            significance=significance,
        )
