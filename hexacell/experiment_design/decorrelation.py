"""The measurement that would best part two parameters which the records determine only together.

Tried is one more record at each point measured so far: the platform tilted about x or y, or turned
about z, from level. What the record would do to the covariance C follows from its Jacobian H against
the point's reference and its own covariance V, before it is measured:

    C' = C - C H^T (H C H^T + V)^-1 H C.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.experiment_design.candidates import Candidates, ReachableTargets, reachable
from hexacell.experiment_design.gauge_zero import GaugeZero, estimate_gauge_zero
from hexacell.experiment_design.predicted_records import SAFETY_SIGMAS, TRAVEL_SHARE, predict_records
from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.correlations import CorrelatedPair
from hexacell.identification.solver.result import Identification
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

ANGLES = np.radians([10.0, 20.0, 30.0, 40.0])
MOST_POINTS = 12
WORTHWHILE = 1.1
"""How many times farther from one a correlation must get for a measurement to be named."""


@dataclass(frozen=True, slots=True)
class DecorrelatingPose:
    """One more record, and what it would do to a pair of parameters.

    Attributes:
        point: as people count them.
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

    Records are within the limits and surely inside the gauges' travel.
    """
    names = found.problem.mechanism.convention.free_names()
    trials = list(_trials(belief, found)) if pairs else []
    return tuple(_best(trials, (names.index(pair.first), names.index(pair.second)), pair) for pair in pairs)


@dataclass(frozen=True, slots=True, eq=False)
class _Trials:
    """Candidates at a point, and ``factors`` (n, 3, p) with ``C' = C - factors^T factors``."""

    point: int
    candidates: Candidates
    factors: Array
    covariance: Array

    def correlations(self, rows: tuple[int, int]) -> Array:
        """The correlation (n,) of two parameters after each candidate."""
        chosen = self.factors[..., rows]
        block = self.covariance[np.ix_(rows, rows)] - np.swapaxes(chosen, -1, -2) @ chosen
        correlations: Array = block[:, 0, 1] / np.sqrt(block[:, 0, 0] * block[:, 1, 1])
        return correlations

    def parting(self, row: int, correlation: float) -> DecorrelatingPose:
        turn = rotations.to_vector(self.candidates.targets.rotations[row])
        axis = int(np.argmax(np.abs(turn)))
        command = self.candidates.commands.pose(row)
        return DecorrelatingPose(self.point, "xyz"[axis], float(turn[axis]), command, correlation)


def _trials(belief: RobotBelief, found: Identification) -> Iterator[_Trials]:
    """What could be measured at each point, or at some of very many."""
    problem = found.problem
    ends = np.append(problem.first_rows[1:], problem.records)
    step = -(-problem.points // MOST_POINTS)
    for first, end in list(zip(problem.first_rows, ends, strict=True))[::step]:
        rows = slice(int(first), int(end))
        at = estimate_gauge_zero(belief, found.poses[rows], problem.joints[rows], problem.deviations[rows])
        candidates = reachable(belief, PoseBatch.at(at.reference, _turns()))
        if len(candidates):
            yield _tried(belief, at, int(problem.labels[first, 0]), candidates)


def _turns() -> Array:
    """Rotations (24, 3, 3) about x, y and z, both ways."""
    angles = np.concatenate([ANGLES, -ANGLES])
    return rotations.from_vector((angles[:, None, None] * np.eye(3)).reshape(-1, 3))


def _tried(belief: RobotBelief, at: GaugeZero, point: int, candidates: Candidates) -> _Trials:
    offered = predict_records(belief, at, ReachableTargets(candidates.targets, candidates.joints))
    inside = SAFETY_SIGMAS * offered.sigma.max(axis=-1) <= TRAVEL_SHARE * belief.limits.gauge_travel_mm
    crossing = offered.jacobian @ belief.covariance
    spread = crossing @ np.swapaxes(offered.jacobian, -1, -2) + offered.covariance
    factors = np.linalg.solve(np.linalg.cholesky(spread), crossing)
    return _Trials(point, candidates[inside], factors[inside], belief.covariance)


def _best(
    trials: Sequence[_Trials], rows: tuple[int, int], pair: CorrelatedPair
) -> DecorrelatingPose | None:
    best: DecorrelatingPose | None = None
    smallest = 1.0 - WORTHWHILE * (1.0 - abs(pair.correlation))
    for trial in trials:
        correlations = trial.correlations(rows)
        if not len(correlations):
            continue
        row = int(np.argmin(np.abs(correlations)))
        if abs(correlations[row]) < smallest:
            smallest = float(abs(correlations[row]))
            best = trial.parting(row, float(correlations[row]))
    return best
