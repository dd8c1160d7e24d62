"""The estimate while measuring: each one starts from the one before it (:mod:`.estimate_chain`).

The estimate of n records is defined as the n-th of this chain, which begins at the drawing. Keeping the
last one saves its computation and changes nothing: without it the chain is computed again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hexacell.campaign.estimate_chain import ChainedEstimate, update_estimate
from hexacell.campaign.pilots import are_counted
from hexacell.design.predicted_records import GaugeZero, gauge_zero_at
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.result import Identification
from hexacell.measurements.records import MeasurementSet, Record, RecordId
from hexacell.robot.model import Robot


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """The estimate of the robot from the records so far.

    Attributes:
        identification: none before the first record.
        false_records: those that the others prove false; they are not in the identification.
    """

    belief: RobotBelief
    identification: Identification | None
    false_records: frozenset[RecordId] = frozenset()

    def of_records_alone(self) -> Identification | None:
        """The identification without pilot records, from this one on; none before the first record."""
        found = self.identification
        if found is None or (counted := are_counted(found.problem)).all():
            return found
        problem, poses = found.problem.subset(counted), found.poses[np.flatnonzero(counted)]
        return estimate_online(problem.starting_at(found.free, poses))

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
        self._last: ChainedEstimate | None = None
        self._problem: Problem | None = None

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate from some records, in their order.

        Raises:
            IdentifiabilityError: they do not belong to this robot.
        """
        records = measurements.records
        if records[: len(self._records)] != self._records:
            self._records, self._last, self._problem = (), None, None
        for count in range(len(self._records) + 1, len(records) + 1):
            self._problem = self._robot.problem(MeasurementSet(records[:count]), self._problem)
            self._last = update_estimate(self._problem, self._last, self._tries_other_starts)
            self._records = records[:count]
        if self._last is None:
            return OnlineEstimate(self._robot.belief(), None)
        found = self._last.identification
        return OnlineEstimate(self._robot.belief(found), found, self._last.false_records)
