"""The record that would best separate two parameters whose estimates are strongly correlated.

One more record is tried at each point measured so far: the level platform tilted about x or y, or rotated
about z. The covariance after it is predicted as in :mod:`hexacell.experiment_design.criteria`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.experiment_design.candidates import reachable
from hexacell.experiment_design.criteria import update_factors
from hexacell.experiment_design.predicted_records import (
    SAFETY_SIGMAS,
    TRAVEL_SHARE,
    PredictedRecords,
    estimate_gauge_zero,
    predict_records,
)
from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.parameter_checks import CorrelatedPair
from hexacell.identification.solver.result import Identification
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

ANGLES = np.radians([10.0, 20.0, 30.0, 40.0])
MOST_POINTS = 12
LEAST_IMPROVEMENT = 1.1
"""How many times farther from one a correlation must become for a record to be proposed."""


@dataclass(frozen=True, slots=True)
class DecorrelatingPose:
    """One more record, and what it would do to a pair of parameters.

    Attributes:
        point: counted from 1.
        axis: of the base frame, ``x``, ``y`` or ``z``.
        degrees: angle away from the level platform, deg.
        command: what brings the controller there, in the mechanism's frame convention.
        correlation: of the pair afterwards.
    """

    point: int
    axis: str
    degrees: float
    command: Pose
    correlation: float


def decorrelating_poses(
    belief: RobotBelief, found: Identification, pairs: Sequence[CorrelatedPair]
) -> tuple[DecorrelatingPose | None, ...]:
    """For each pair the record that lowers its correlation most; none where no record does.

    Records keep the limits and are almost surely inside the gauges' travel.
    """
    names = found.problem.mechanism.convention.free_names()
    trials = list(_trials(belief, found)) if pairs else []
    return tuple(_best(trials, (names.index(pair.first), names.index(pair.second)), pair) for pair in pairs)


@dataclass(frozen=True, slots=True, eq=False)
class _Trials:
    """Records (n) at a point, their commands, and their :func:`update_factors` (n, 3, p)."""

    point: int
    orientations: Array
    commands: PoseBatch
    factors: Array
    covariance: Array

    def correlations(self, rows: tuple[int, int]) -> Array:
        """The correlation (n,) of two parameters after each record."""
        factors = self.factors[..., rows]
        block = self.covariance[np.ix_(rows, rows)] - np.swapaxes(factors, -1, -2) @ factors
        correlations: Array = block[:, 0, 1] / np.sqrt(block[:, 0, 0] * block[:, 1, 1])
        return correlations

    def pose(self, row: int, correlation: float) -> DecorrelatingPose:
        angles = np.degrees(rotations.to_vector(self.orientations[row]))
        axis = int(np.argmax(np.abs(angles)))
        command = self.commands.pose(row)
        return DecorrelatingPose(self.point, "xyz"[axis], float(angles[axis]), command, correlation)


def _trials(belief: RobotBelief, found: Identification) -> Iterator[_Trials]:
    """What could be measured at each point, or at some of very many."""
    problem = found.problem
    ends = np.append(problem.first_rows[1:], problem.records)
    step = -(-problem.points // MOST_POINTS)
    for first, end in list(zip(problem.first_rows, ends, strict=True))[::step]:
        rows = slice(int(first), int(end))
        zero = estimate_gauge_zero(
            belief, found.poses[rows], problem.joints[rows], problem.deviations[rows]
        )
        targets, commands = reachable(belief, PoseBatch.at(zero.reference, _rotations()))
        if len(targets):
            records = predict_records(belief, zero, targets)
            yield _trials_at(belief, int(problem.labels[first, 0]), records, commands)


def _rotations() -> Array:
    """Rotations (24, 3, 3) about x, y and z in both directions."""
    angles = np.concatenate([ANGLES, -ANGLES])
    return rotations.from_vector((angles[:, None, None] * np.eye(3)).reshape(-1, 3))


def _trials_at(belief: RobotBelief, point: int, records: PredictedRecords, commands: PoseBatch) -> _Trials:
    inside = SAFETY_SIGMAS * records.sigma.max(axis=-1) <= TRAVEL_SHARE * belief.limits.gauge_travel_mm
    factors = update_factors(belief.covariance, records.jacobian, records.covariance)
    orientations = records.targets.poses.rotations
    return _Trials(point, orientations[inside], commands[inside], factors[inside], belief.covariance)


def _best(
    trials: Sequence[_Trials], rows: tuple[int, int], pair: CorrelatedPair
) -> DecorrelatingPose | None:
    best: DecorrelatingPose | None = None
    smallest = 1.0 - LEAST_IMPROVEMENT * (1.0 - abs(pair.correlation))
    for trial in trials:
        correlations = trial.correlations(rows)
        if not len(correlations):
            continue
        row = int(np.argmin(np.abs(correlations)))
        if abs(correlations[row]) < smallest:
            smallest = float(abs(correlations[row]))
            best = trial.pose(row, float(correlations[row]))
    return best
