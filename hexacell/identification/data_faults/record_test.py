"""One record that took no part in a solution, judged by it: does it agree, and if not, why?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from hexacell.identification.data_faults.hypotheses import GAUGE_FAULTS, Label, record_ids, record_mask
from hexacell.identification.data_faults.score_tests import LinearizedModel, OutlierStatistics
from hexacell.identification.problem.encoder_consistency import inconsistent_leg
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.identification.solver.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.solver.regularized_fit import Fit
from hexacell.identification.solver.result import GAUGES, DataFaultKind
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

LEAST_MISREAD_MM = 1.0
"""A gross error smaller than this resembles some misreading or other by chance."""

NOT_SURPRISING = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class RecordVerdict:
    """What a solution says about a record.

    Attributes:
        agrees: whether it does not differ from what is expected by more than chance allows.
        kind: if it does not agree, why.
        gauges: of ``xyz``, those that alone are wrong; empty where no single one is.
        off: (3,), mm, what the gauges x, y and z show too much; none next to a singularity.
        statistic: squared standardised length of that; infinite next to a singularity.
        stray: the leg (from 1) that does not stand where it was sent, and how far off, mm.
    """

    agrees: bool
    kind: DataFaultKind
    gauges: str
    off: Array | None
    statistic: float
    stray: tuple[int, float] | None


def test_record(problem: Problem, label: Label, found: Fit, *, found_before: int) -> RecordVerdict:
    """Judge one record of a problem by a fit that it took no part in."""
    stray = _stray(problem, label)
    expansion = _with_record(problem, label, found)
    if expansion is None:
        return RecordVerdict(
            False,
            DataFaultKind.FOREIGN_JOINTS if stray else DataFaultKind.SINGULAR,
            "",
            None,
            np.inf,
            stray,
        )
    row = int(np.flatnonzero(record_mask(expansion.problem, [label]))[0])
    tests = OutlierStatistics.of(expansion)
    own, gauges = expansion.weights[row], expansion.problem.gauges
    information = gauges.T @ own @ expansion.residual_covariance[row] @ own @ gauges
    off = -np.linalg.pinv(information, hermitian=True) @ (gauges.T @ expansion.scores[row])
    shown = expansion.problem.deviations[row] @ gauges
    kind, wrong = _explanation(off, shown, information / tests.scale)
    agrees = bool(tests.threshold_ratio(found_before)[row] <= 1.0)
    if stray and not wrong:
        kind = DataFaultKind.FOREIGN_JOINTS
    return RecordVerdict(agrees, kind, wrong, off, float(tests.omnibus[row]), stray)


def _stray(problem: Problem, label: Label) -> tuple[int, float] | None:
    row = int(np.flatnonzero(record_mask(problem, [label]))[0])
    others = problem.labels[:, 0] == label[0]
    others[row] = False
    return inconsistent_leg(problem.commands, problem.joints, row, others)


def poses_at(problem: Problem, found: Fit) -> tuple[PoseBatch, Mask]:
    """Poses that close a fit's geometry at all records of a problem, and which (n,) were found."""
    geometry = Geometry.from_vector(problem.basis @ found.solution.free)
    reached = problem.commands.solve_poses(geometry, problem.joints)
    return reached.poses, reached.found


def _with_record(problem: Problem, label: Label, found: Fit) -> LinearizedModel | None:
    """The expansion of a fit in its own records and one more; none if that is next to a singularity."""
    some = problem.subset(record_mask(problem, {label, *record_ids(found.problem)}))
    poses, reached = poses_at(some, found)
    row = int(np.flatnonzero(record_mask(some, [label]))[0])
    if not reached.all():
        return None
    prediction = measurement_model.predict(some, found.solution.free, poses)
    if prediction.amplification[row] > LARGEST_AMPLIFICATION:
        return None
    return LinearizedModel.around(some, prediction, found.active_prior)


def _explanation(off: Array, shown: Array, information: Array) -> tuple[DataFaultKind, str]:
    """The simplest one: a known misreading, else one wrong gauge, else a wrong record."""
    if np.abs(off).max() > LEAST_MISREAD_MM:
        rests = [off + misreading.remedy @ shown - shown for misreading in GAUGE_FAULTS]
        squares = [float(rest @ information @ rest) for rest in rests]
        best = int(np.argmin(squares))
        if squares[best] < chdtri(3, NOT_SURPRISING):
            return GAUGE_FAULTS[best].kind, GAUGE_FAULTS[best].gauges
    along = (information @ off) ** 2 / np.maximum(np.diag(information), 1e-300)
    worst = int(np.argmax(along))
    rest_of_it = float(off @ information @ off - along[worst])
    return DataFaultKind.GROSS_ERROR, GAUGES[worst] if rest_of_it < chdtri(2, NOT_SURPRISING) else ""
