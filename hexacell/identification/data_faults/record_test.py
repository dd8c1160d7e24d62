"""The deletion test of one record: does it agree with a fit that it took no part in, and if not, why?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults.gauge_faults import GAUGE_FAULTS
from hexacell.identification.data_faults.hypotheses import record_ids, record_mask
from hexacell.identification.data_faults.score_tests import OutlierStatistics
from hexacell.identification.problem.encoder_consistency import ACCEPTED_MM
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.identification.solver.linearized_model import LinearizedModel
from hexacell.identification.solver.result import GAUGES, DataFault, DataFaultKind, Identification
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import RecordId

SMALLEST_GAUGE_FAULT_MM = 1.0
"""A smaller gross error resembles some gauge fault by chance."""

SIGNIFICANCE = 1e-3

MIN_COMPARED_RECORDS = 3
OUTLIER_SCATTERS = 10.0
"""Median absolute deviations beyond which a joint variable is an outlier."""


@dataclass(frozen=True, slots=True, eq=False)
class DeletionTest:
    """The test of a record against a fit without it.

    Attributes:
        fault: what is wrong with the record if it disagrees.
        statistics: the tests of the fit's records and this one; none next to a singularity.
        row: the record among them.
    """

    fault: DataFault
    statistics: OutlierStatistics | None = None
    row: int = 0

    @property
    def significance(self) -> float:
        """The larger statistic of the record over its critical value; infinite without tests."""
        if self.statistics is None:
            return float("inf")
        return float(self.statistics.threshold_ratio()[self.row])

    def agrees(self, found_before: int = 0) -> bool:
        """Whether chance explains the difference, after some records that certainly disagree."""
        if self.statistics is None:
            return False
        return bool(self.statistics.threshold_ratio(found_before)[self.row] <= 1.0)


def deletion_test(problem: Problem, record: RecordId, fit: Identification) -> DeletionTest:
    """Test one record of a problem against a fit that it took no part in."""
    leg = _inconsistent_leg(problem, record)
    model = _model_with(problem, record, fit)
    if model is None:
        kind = DataFaultKind.MISMATCHED_JOINTS if leg else DataFaultKind.SINGULAR
        return DeletionTest(messages.rejected_record(record, kind, leg=leg))
    row = _row(model.problem, record)
    statistics = OutlierStatistics.of(model)
    weights, gauges = model.weights[row], model.problem.gauges
    information = gauges.T @ weights @ model.residual_covariance[row] @ weights @ gauges
    offset = -np.linalg.pinv(information, hermitian=True) @ (gauges.T @ model.scores[row])
    readings = model.problem.deviations[row] @ gauges
    kind, faulty = _simplest_cause(offset, readings, information / statistics.scale)
    if leg and not faulty:
        kind = DataFaultKind.MISMATCHED_JOINTS
    fault = messages.rejected_record(
        record,
        kind,
        gauges=faulty,
        offset_mm=(float(offset[0]), float(offset[1]), float(offset[2])),
        leg=leg,
    )
    return DeletionTest(fault, statistics, row)


def _row(problem: Problem, record: RecordId) -> int:
    return int(np.flatnonzero(record_mask(problem, [record]))[0])


def _inconsistent_leg(problem: Problem, record: RecordId) -> tuple[int, float] | None:
    """The leg (from 1) whose joint variable in one record is an outlier, and its offset, mm; or None.

    The test compares the differences between measured and commanded joint variables with their median
    over the other records of the point. They change little between the poses of a point, whatever
    geometry the controller had.
    """
    row = _row(problem, record)
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
    """The linear model of a fit's records and one more; none if that is next to a singularity."""
    some = problem.subset(record_mask(problem, {record, *record_ids(fit.problem)}))
    solved = some.solve_poses(fit.free)
    if not solved.found.all():
        return None
    prediction = measurement_model.predict(some, fit.free, solved.poses)
    if prediction.singular[_row(some, record)]:
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
