"""The estimate while measuring: each one starts from the one before it.

One more record changes the estimate little, so that the search starts at the former estimate. The estimate
of n records is defined as the n-th of this chain, which begins at the drawing. Keeping the last one saves
its computation and changes nothing: without it the chain is computed again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.predicted_records import GaugeZero, gauge_zero_at
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import COARSE, INCREMENTAL
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot_model import Robot

IMPLAUSIBLE_COST = 3.0
"""Per residual. A larger cost may be that of a local minimum, and other starts are tried."""

FEW_RESIDUALS = 30.0
"""Added to their number, since few of them may be large by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """The estimate of the robot from the records so far; ``identification`` is None before the first."""

    belief: RobotBelief
    identification: Identification | None

    def gauge_zero(self, point: int) -> GaugeZero:
        """Where a point's gauges were zeroed.

        Raises:
            LimitError: there are no records of the point.
        """
        found = self.identification
        if found is None or point not in found.problem.labels[:, 0]:
            raise LimitError("the records of this point do not determine the ball's position")
        return gauge_zero_at(self.belief, found, point)


class RecordEstimator(Protocol):
    """Estimates the robot from any records."""

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate from some records, in their order.

        Raises:
            IdentifiabilityError: they do not belong to this robot.
        """
        ...


class OnlineEstimator:
    """Estimates from any records, quickly where they continue the last ones asked for.

    With ``tries_other_starts`` false an implausible estimate is kept: the robot is near its prior, or the
    prior is wrong.
    """

    def __init__(self, robot: Robot, *, tries_other_starts: bool = True) -> None:
        self._robot = robot
        self._tries_other_starts = tries_other_starts
        self._records: tuple[Record, ...] = ()
        self._last: Identification | None = None

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate from some records, in their order.

        Raises:
            IdentifiabilityError: they do not belong to this robot.
        """
        records = measurements.records
        if records[: len(self._records)] != self._records:
            self._records, self._last = (), None
        for count in range(len(self._records) + 1, len(records) + 1):
            problem = self._robot.problem(MeasurementSet(records[:count]))
            self._last = update_estimate(problem, self._last, self._tries_other_starts)
            self._records = records[:count]
        return OnlineEstimate(self._robot.belief(self._last), self._last)


def update_estimate(
    problem: Problem, before: Identification | None, tries_other_starts: bool = True
) -> Identification:
    """The estimate from that of all records but the last; from other starts if it is implausible."""
    poses = None if before is None else _start_poses(problem, before)
    if before is None or poses is None:
        return estimate_online(problem)
    # While the records leave much open, undamped steps may diverge.
    options = INCREMENTAL if is_determined(problem) else COARSE
    found = estimate_online(problem.starting_at(before.free, poses), options)
    others = _from_other_starts(problem) if tries_other_starts else iter(())
    while not _is_plausible(problem, found) and (other := next(others, None)):
        is_better = (other.records, -cost(other)) > (found.records, -cost(found))
        found = other if is_better else found
    return found


def cost(found: Identification) -> float:
    """What the estimate minimized: squared residuals and distance from the drawing, both by sigma."""
    return found.chi2 + found.problem.prior.squared_distance(found.free)


def _is_plausible(problem: Problem, found: Identification) -> bool:
    is_small = cost(found) <= IMPLAUSIBLE_COST * found.problem.coordinates + FEW_RESIDUALS
    return found.converged and found.records == problem.records and is_small


def _from_other_starts(problem: Problem) -> Iterator[Identification]:
    """Estimates from the drawing, and from random geometries within the tolerances.

    With few records, one of them may be beyond a singularity for all robots near the drawing.
    """
    yield estimate_online(problem)
    yield from map(estimate_online, restarts(problem))


def _start_poses(problem: Problem, before: Identification) -> PoseBatch | None:
    """Poses that close the former estimate, to start the search; none if one is not found."""
    rows = {tuple(label): row for row, label in enumerate(problem.labels.tolist())}
    old = np.array([rows[tuple(label)] for label in before.problem.labels.tolist()], dtype=np.intp)
    new = np.setdiff1d(np.arange(problem.records), old)
    solved = problem.commands[new].solve_poses(before.geometry, problem.joints[new])
    if not solved.found[problem.has_start_pose[new]].all():
        return None
    return problem.commands.poses.with_rows(new, solved.poses).with_rows(old, before.poses)
