"""Deletion tests of records that were left out: does a record agree with the fit, and is its fault proven?

A record that took no part in a fit is compared with what the fit predicts of it (:func:`deletion_tests`).
One that agrees is readmitted. Of one that does not, the simplest cause is looked for: a leg whose joint
variable is off, a gauge fault, one wrong gauge, or several.

What proves a fault is that the rest of the records, without it, agrees with the stated noise
(:func:`proven_faults`; ``docs/method.md``, Proof): the less it does, the further beyond its critical value
the statistic of the fault must be. What is not proven stays in the fit, and no cause is named. The factors
separate the worlds of ``tests/benchmarks/worlds``: the largest statistic of an imperfect machine is 4.1
critical values, and that of a reading off by 0.5 mm in a good one at least 4.8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.hypotheses import (
    GAUGE_FAULTS,
    FaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
)
from hexacell.identification.data_faults.score_tests import OutlierStatistics
from hexacell.identification.data_faults.trial_fits import CorrectedFit
from hexacell.identification.problem.commanded_poses import ACCEPTED_MM
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.result import GAUGES, DataFaultKind, Identification
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Deviation, RecordId, deviation_of

SMALLEST_GAUGE_FAULT_MM = 1.0
"""A smaller gross error resembles some gauge fault by chance."""

SIGNIFICANCE = 1e-3

MIN_COMPARED_RECORDS = 3
OUTLIER_SCATTERS = 10.0
"""Median absolute deviations beyond which a joint variable is an outlier."""

GOOD_AGREEMENT = 0.05
"""Probability of the residuals of the rest from which they agree well."""

BESIDE_GOOD, BESIDE_AGREEING, BESIDE_DISAGREEING = 1.3, 4.0, 10.0


@dataclass(frozen=True, slots=True, eq=False)
class DeletionTest:
    """The test of a record against a fit without it, and what is wrong with it if it disagrees.

    Attributes:
        gauges: the faulty gauges, of ``xyz``; empty if no single one is at fault.
        offset_mm: the errors of the gauges x, y and z; None next to a singularity.
        leg: a leg (from 1) whose joint variable is an outlier, and its distance from the commanded
            position, mm.
        statistics: the tests of the fit's records and this one; None next to a singularity.
    """

    record: RecordId
    kind: DataFaultKind
    leg: tuple[int, float] | None
    gauges: str = ""
    offset_mm: Deviation | None = None
    statistics: OutlierStatistics | None = None
    row: int = 0

    @property
    def significance(self) -> float:
        """The larger statistic of the record over its critical value; infinite where it is certain."""
        if self.statistics is None or self.is_certain:
            return float("inf")
        return float(self.statistics.threshold_ratio()[self.row])

    @property
    def is_certain(self) -> bool:
        """Whether the record is false whatever the fit says, as joint variables of another command are."""
        return self.statistics is None or self.kind is DataFaultKind.MISMATCHED_JOINTS

    def agrees(self, found_before: int = 0) -> bool:
        """Whether chance explains the difference, after some records that certainly disagree."""
        if self.statistics is None:
            return False
        return bool(self.statistics.threshold_ratio(found_before)[self.row] <= 1.0)


def deletion_tests(selected: CorrectedFit) -> dict[RecordId, DeletionTest]:
    """Test gross errors and records that the solver left out, but not those after a zero shift."""
    if selected.fit.records == selected.original.records:
        return {}
    excluded = {record for shift in selected.zero_shifts for record in selected.after(shift)}
    excluded.update(selected.fit.problem.record_ids)
    return {
        record: deletion_test(selected.original, record, selected.fit)
        for record in selected.original.record_ids
        if record not in excluded
    }


def deletion_test(problem: Problem, record: RecordId, fit: Identification) -> DeletionTest:
    """Test one record of a problem against a fit that it took no part in."""
    leg = _inconsistent_leg(problem, record)
    model = _model_with(problem, record, fit)
    if model is None:
        return DeletionTest(record, DataFaultKind.MISMATCHED_JOINTS if leg else DataFaultKind.SINGULAR, leg)
    row = int(np.flatnonzero(model.problem.mask_of([record]))[0])
    statistics = OutlierStatistics.of(model)
    weights, gauges = model.weights[row], model.problem.gauges
    information = gauges.T @ weights @ model.residual_covariance[row] @ weights @ gauges
    offset = -np.linalg.pinv(information, hermitian=True) @ (gauges.T @ model.scores[row])
    readings = model.problem.deviations[row] @ gauges
    kind, faulty = _simplest_cause(offset, readings, information / statistics.scale)
    if leg and not faulty:
        kind = DataFaultKind.MISMATCHED_JOINTS
    return DeletionTest(record, kind, leg, faulty, deviation_of(offset), statistics, row)


def _inconsistent_leg(problem: Problem, record: RecordId) -> tuple[int, float] | None:
    """The leg (from 1) whose joint variable in one record is an outlier, and its offset, mm; or None.

    The test compares the differences between measured and commanded joint variables with their median
    over the other records of the point. They change little between the poses of a point, whatever
    geometry the controller had.
    """
    row = int(np.flatnonzero(problem.mask_of([record]))[0])
    misfit = problem.joints - problem.commands.joints
    is_other = (problem.labels[:, 0] == record[0]) & (np.arange(problem.records) != row)
    known = misfit[is_other & np.isfinite(misfit).all(axis=-1)]
    if len(known) < MIN_COMPARED_RECORDS or not np.isfinite(misfit[row]).all():
        return None
    usual = np.median(known, axis=0)
    scatter = np.median(np.abs(known - usual), axis=0)
    off = misfit[row] - usual
    beyond = np.abs(off) - ACCEPTED_MM - OUTLIER_SCATTERS * scatter
    leg = int(np.argmax(beyond))
    return (leg + 1, float(off[leg])) if beyond[leg] > 0.0 else None


def _model_with(problem: Problem, record: RecordId, fit: Identification) -> LinearizedModel | None:
    """The linear model of a fit's records and one more; None if that is next to a singularity."""
    some = problem.subset(problem.mask_of({record, *fit.problem.record_ids}))
    solved = some.solve_poses(fit.free)
    if not solved.found.all():
        return None
    prediction = predict(some, fit.free, solved.poses)
    if prediction.singular[some.mask_of([record])].any():
        return None
    return LinearizedModel.around(some, prediction, fit.active_prior)


def _simplest_cause(offset: Array, readings: Array, information: Array) -> tuple[DataFaultKind, str]:
    """A gauge fault if one explains the offset, else one wrong gauge, else a wrong record."""
    if np.abs(offset).max() > SMALLEST_GAUGE_FAULT_MM:
        unexplained = [offset + fault.remedy @ readings - readings for fault in GAUGE_FAULTS]
        squares = [float(rest @ information @ rest) for rest in unexplained]
        best = int(np.argmin(squares))
        if squares[best] < chi_square_limit(3, SIGNIFICANCE):
            return GAUGE_FAULTS[best].kind, GAUGE_FAULTS[best].gauges
    along = (information @ offset) ** 2 / np.maximum(np.diag(information), 1e-300)
    worst = int(np.argmax(along))
    others = float(offset @ information @ offset - along[worst])
    return DataFaultKind.GROSS_ERROR, GAUGES[worst] if others < chi_square_limit(2, SIGNIFICANCE) else ""


def required_significance(rest: ChiSquareTest, faults: int) -> float:
    """How many critical values the statistic of a fault must reach beside the rest of the records.

    The more ``faults`` are chosen, the less it proves that the rest agrees.
    """
    if rest.probability > GOOD_AGREEMENT and faults == 1:
        return BESIDE_GOOD
    return BESIDE_AGREEING if rest.is_explained else BESIDE_DISAGREEING


def proven_faults(
    selected: CorrectedFit, tests: Mapping[RecordId, DeletionTest]
) -> tuple[FaultHypothesis, ...]:
    """The faults of a fit that the rest of its records proves; ``tests`` are those of the left-out ones."""
    rest = selected.fit.goodness
    can_prove = selected.fit.problem.is_overdetermined
    records = {
        record: tests[record].significance if can_prove or tests[record].is_certain else 0.0
        for record in selected.rejected
    }
    shifts = {shift: shift.significance for shift in selected.zero_shifts}
    significances = [*shifts.values(), *records.values()]
    required = required_significance(rest, len(significances))
    if rest.probability > GOOD_AGREEMENT and max(significances, default=0.0) >= required:
        return selected.faults
    proven = {record for record, significance in records.items() if significance >= required}
    kept: list[FaultHypothesis] = []
    for fault in selected.faults:
        match fault:
            case OutlierHypothesis():
                part = fault.only(proven)
                kept += [part] if part.records else []
            case ZeroShiftHypothesis() if fault.significance < required:
                continue
            case _:
                kept.append(fault)
    return tuple(kept)
