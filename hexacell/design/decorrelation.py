"""The record that would best separate two parameters whose estimates are strongly correlated.

One more record is tried at each point measured so far: the level platform tilted about x or y, or rotated
about z. The covariance after it is predicted as in :mod:`hexacell.design.criteria`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.design.candidates import reachable
from hexacell.design.criteria import update_factors
from hexacell.design.predicted_records import SAFETY_SIGMAS, TRAVEL_SHARE, gauge_zero_at, predict_records
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.result import CorrelatedPair, Identification
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
    """For each pair the record that lowers its correlation most; None where no record does.

    Records keep the limits and are almost surely inside the gauges' travel.
    """
    names = found.problem.mechanism.convention.free_names
    trials = list(_trials(belief, found)) if pairs else []
    return tuple(
        _best(trials, belief.covariance, (names.index(pair.first), names.index(pair.second)), pair)
        for pair in pairs
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A record at a point: the platform (3, 3), the command (1), and :func:`update_factors` (3, p)."""

    point: int
    orientation: Array
    command: PoseBatch
    factors: Array


def _trials(belief: RobotBelief, found: Identification) -> Iterator[_Trial]:
    """Records that could be measured at each point, or at some of very many."""
    points = found.problem.labels[found.problem.first_rows, 0]
    angles = np.concatenate([ANGLES, -ANGLES])[:, None, None] * np.eye(3)
    tried = rotations.from_vector(angles.reshape(-1, 3))
    for point in points[:: -(-len(points) // MOST_POINTS)].tolist():
        zero = gauge_zero_at(belief, found, point)
        targets, commands = reachable(belief, PoseBatch.at(zero.reference, tried))
        if not len(targets):
            continue
        records = predict_records(belief, zero, targets)
        spread = SAFETY_SIGMAS * records.sigma
        inside = belief.limits.surely_zeroed().within_travel(np.zeros(3), spread, TRAVEL_SHARE)
        factors = update_factors(belief.joint_covariance, records.jacobian, records.covariance)
        for row in np.flatnonzero(inside).tolist():
            yield _Trial(point, targets.poses.rotations[row], commands[[row]], factors[row])


def _best(
    trials: Sequence[_Trial], covariance: Array, rows: tuple[int, int], pair: CorrelatedPair
) -> DecorrelatingPose | None:
    """The record with the smallest correlation of two parameters, if it is worth measuring."""
    if not trials:
        return None
    factors = np.array([trial.factors[:, rows] for trial in trials])
    after = covariance[np.ix_(rows, rows)] - np.swapaxes(factors, -1, -2) @ factors
    correlations = after[:, 0, 1] / np.sqrt(after[:, 0, 0] * after[:, 1, 1])
    best = int(np.argmin(np.abs(correlations)))
    if abs(correlations[best]) >= 1.0 - LEAST_IMPROVEMENT * (1.0 - abs(pair.correlation)):
        return None
    angles = np.degrees(rotations.to_vector(trials[best].orientation))
    axis = int(np.argmax(np.abs(angles)))
    return DecorrelatingPose(
        point=trials[best].point,
        axis="xyz"[axis],
        degrees=float(angles[axis]),
        command=trials[best].command.pose(0),
        correlation=float(correlations[best]),
    )
