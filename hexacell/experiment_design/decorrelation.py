"""The record that would best separate two parameters whose estimates are strongly correlated.

One more record is tried at each point measured so far: the level platform tilted about x or y, or rotated
about z. The covariance C after it is predicted from the record's Jacobian H, relative to the point's
reference, and its covariance V (Kalman update):

    C' = C - C H^T (H C H^T + V)^-1 H C = C - F^T F.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.experiment_design.candidates import Candidates, reachable
from hexacell.experiment_design.predicted_records import (
    SAFETY_SIGMAS,
    TRAVEL_SHARE,
    GaugeZero,
    estimate_gauge_zero,
    predict_records,
)
from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.correlations import CorrelatedPair
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
        angle: away from the level platform, rad.
        command: what brings the controller there, in the mechanism's frame convention.
        correlation: of the pair afterwards.
    """

    point: int
    axis: str
    angle: float
    command: Pose
    correlation: float

    @property
    def degrees(self) -> float:
        """:attr:`angle`, deg."""
        return float(np.degrees(self.angle))


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
    """Candidates (n) at a point, and ``factors`` F (n, 3, p) with ``C' = C - F^T F``."""

    point: int
    candidates: Candidates
    factors: Array
    covariance: Array

    def correlations(self, rows: tuple[int, int]) -> Array:
        """The correlation (n,) of two parameters after each candidate."""
        factors = self.factors[..., rows]
        block = self.covariance[np.ix_(rows, rows)] - np.swapaxes(factors, -1, -2) @ factors
        correlations: Array = block[:, 0, 1] / np.sqrt(block[:, 0, 0] * block[:, 1, 1])
        return correlations

    def pose(self, row: int, correlation: float) -> DecorrelatingPose:
        vector = rotations.to_vector(self.candidates.targets.poses.rotations[row])
        axis = int(np.argmax(np.abs(vector)))
        command = self.candidates.commands.pose(row)
        return DecorrelatingPose(self.point, "xyz"[axis], float(vector[axis]), command, correlation)


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
        candidates = reachable(belief, PoseBatch.at(zero.reference, _rotations()))
        if len(candidates):
            yield _trials_at(belief, zero, int(problem.labels[first, 0]), candidates)


def _rotations() -> Array:
    """Rotations (24, 3, 3) about x, y and z in both directions."""
    angles = np.concatenate([ANGLES, -ANGLES])
    return rotations.from_vector((angles[:, None, None] * np.eye(3)).reshape(-1, 3))


def _trials_at(belief: RobotBelief, zero: GaugeZero, point: int, candidates: Candidates) -> _Trials:
    records = predict_records(belief, zero, candidates.targets)
    inside = SAFETY_SIGMAS * records.sigma.max(axis=-1) <= TRAVEL_SHARE * belief.limits.gauge_travel_mm
    crossing = records.jacobian @ belief.covariance
    total = crossing @ np.swapaxes(records.jacobian, -1, -2) + records.covariance
    factors = np.linalg.solve(np.linalg.cholesky(total), crossing)
    return _Trials(point, candidates[inside], factors[inside], belief.covariance)


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
