"""The estimate while measuring: each continues the one before it.

What a record more does to the estimate is small, so that the former one is where the search starts.
The estimate of n records is defined as the n-th of this chain, from the drawing on. Keeping the last
link saves its computation and changes nothing: without it the chain is computed again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.gauge_zero import GaugeZero, estimate_gauge_zero
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import COARSE, INCREMENTAL
from hexacell.identification.solver.multistart import start_points
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot_model import Robot

IMPLAUSIBLE = 3.0
"""Times the number of residuals: a cost beyond it is looked into, from the drawing on."""

FEW_RESIDUALS = 30.0
"""Added to their number, since few of them may be large by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """What the records so far say of the robot; ``estimate`` is none before the first."""

    belief: RobotBelief
    identification: Identification | None

    def gauge_zero(self, point: int) -> GaugeZero:
        """Where a point's gauges were zeroed.

        Raises:
            LimitError: the records do not say so.
        """
        found = self.identification
        if found is None or point not in found.problem.labels[:, 0]:
            raise LimitError("the records of this point say nothing about where the ball is")
        records = found.problem
        rows = np.flatnonzero(records.labels[:, 0] == point)
        return estimate_gauge_zero(
            self.belief, found.poses[rows], records.joints[rows], records.deviations[rows]
        )


class OnlineEstimator:
    """Gives the estimate of any records, quickly where they continue the last ones asked for."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._records: tuple[Record, ...] = ()
        self._last: Identification | None = None

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """What some records say, in their order.

        Raises:
            IdentifiabilityError: they do not belong to this robot.
        """
        records = measurements.records
        if records[: len(self._records)] != self._records:
            self._records, self._last = (), None
        for count in range(len(self._records) + 1, len(records) + 1):
            problem = self._robot.problem(MeasurementSet(records[:count]))
            self._last = update_estimate(problem, self._last)
            self._records = records[:count]
        return OnlineEstimate(self._robot.belief(self._last), self._last)


def update_estimate(problem: Problem, before: Identification | None) -> Identification:
    """The estimate from the one of all records but the last; from the drawing if that is astray."""
    poses = None if before is None else _poses_under(problem, before)
    if before is None or poses is None:
        return estimate_online(problem)
    # Undamped steps lead some robots astray while the records leave much open.
    options = INCREMENTAL if is_determined(problem) else COARSE
    found = estimate_online(problem, free=before.free, poses=poses, options=options)
    others = _begun_elsewhere(problem)
    while not _is_healthy(problem, found) and (another := next(others, None)):
        better = (another.records, -cost(another)) > (found.records, -cost(found))
        found = another if better else found
    return found


def _is_healthy(problem: Problem, found: Identification) -> bool:
    residuals = 3 * (found.records - found.points)
    plausible = cost(found) <= IMPLAUSIBLE * residuals + FEW_RESIDUALS
    return found.converged and found.records == problem.records and plausible


def _begun_elsewhere(problem: Problem) -> Iterator[Identification]:
    """Searches from the drawing, and from robots that may have been built instead.

    With few records one of these may lie beyond a singularity for all of them.
    """
    yield estimate_online(problem)
    for free, poses in start_points(problem):
        yield estimate_online(problem, free=free, poses=poses)


def cost(found: Identification) -> float:
    """What the estimate minimised: squared residuals and distance from the drawing, by sigma."""
    prior = found.problem.prior
    moved = found.free - found.problem.mechanism.convention.free_parameters(prior.centre)
    return float(found.chi2 + moved @ np.linalg.solve(prior.covariance, moved))


def _poses_under(problem: Problem, before: Identification) -> PoseBatch | None:
    """Poses that close the former estimate where a search may start; none if one is not found."""
    rows = {tuple(label): row for row, label in enumerate(before.problem.labels.tolist())}
    known = [rows.get(tuple(label)) for label in problem.labels.tolist()]
    new = np.array([row for row, place in enumerate(known) if place is None], dtype=np.intp)
    followed = problem.commands[new].solve_poses(before.geometry, problem.joints[new])
    if not followed.found[problem.has_start_pose[new]].all():
        return None
    old = np.array([row for row, place in enumerate(known) if place is not None], dtype=np.intp)
    places = np.array([place for place in known if place is not None], dtype=np.intp)
    positions, rotations = np.empty((problem.records, 3)), np.empty((problem.records, 3, 3))
    positions[new], rotations[new] = followed.poses.positions, followed.poses.rotations
    positions[old], rotations[old] = before.poses.positions[places], before.poses.rotations[places]
    return PoseBatch(positions, rotations)
