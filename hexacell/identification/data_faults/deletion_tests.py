"""Records that a fit does without, compared with what it predicts of them, and what is wrong with each.

If a record disagrees, the simplest cause is looked for: a leg whose joint variable is off, a gauge fault,
one wrong gauge, or several.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults.hypotheses import GAUGE_FAULTS
from hexacell.identification.data_faults.outlier_statistics import OutlierStatistics, model_at
from hexacell.identification.problem.commanded_poses import ACCEPTED_MM
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.result import GAUGES, DataFaultKind, Identification
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Deviation, RecordId, deviation_of

SMALLEST_GAUGE_FAULT_MM = 1.0
"""A smaller gross error resembles some gauge fault by chance."""

CAUSE_PROBABILITY = 1e-3
"""Probability that chance alone speaks against the right cause of a gross error."""

MIN_COMPARED_RECORDS = 3
OUTLIER_SCATTERS = 10.0
"""Median absolute deviations beyond which a joint variable is an outlier."""


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


def deletion_tests(
    problem: Problem, fit: Identification, without: Collection[RecordId]
) -> dict[RecordId, DeletionTest]:
    """Test each record of a problem that a fit does without, but for some others."""
    known = {*fit.problem.record_ids, *without}
    left_out = [record for record in problem.record_ids if record not in known]
    return {record: _deletion_test(problem, fit, record) for record in left_out}


def _deletion_test(problem: Problem, fit: Identification, record: RecordId) -> DeletionTest:
    """The test of one record, by the model of the fit's records and this one around the fit."""
    model = model_at(problem, fit.free, fit.active_prior, among={*fit.problem.record_ids, record})
    leg = _inconsistent_leg(problem, record)
    if model is None or record not in model.problem.record_ids:
        return DeletionTest(record, DataFaultKind.MISMATCHED_JOINTS if leg else DataFaultKind.SINGULAR, leg)
    row, statistics = model.problem.record_ids.index(record), OutlierStatistics.of(model)
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
    row = problem.record_ids.index(record)
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


def _simplest_cause(offset: Array, readings: Array, information: Array) -> tuple[DataFaultKind, str]:
    """A gauge fault if one explains the offset, else one wrong gauge, else a wrong record."""
    if np.abs(offset).max() > SMALLEST_GAUGE_FAULT_MM:
        unexplained = [offset + fault.remedy @ readings - readings for fault in GAUGE_FAULTS]
        squares = [float(rest @ information @ rest) for rest in unexplained]
        best = int(np.argmin(squares))
        if squares[best] < chi_square_limit(3, CAUSE_PROBABILITY):
            return GAUGE_FAULTS[best].kind, GAUGE_FAULTS[best].gauges
    along = (information @ offset) ** 2 / np.maximum(np.diag(information), 1e-300)
    worst = int(np.argmax(along))
    others = float(offset @ information @ offset - along[worst])
    is_alone = others < chi_square_limit(2, CAUSE_PROBABILITY)
    return DataFaultKind.GROSS_ERROR, GAUGES[worst] if is_alone else ""
