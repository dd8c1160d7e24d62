"""What going on would gain: for the person who watches, and to decide which point is worth its time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.budget import Budget
from hexacell.campaign.decisions import CampaignState, Forecast
from hexacell.campaign.information_forecast import (
    PlannedInformation,
    PlannedSets,
    add_information,
    covariance_update,
)
from hexacell.campaign.recursive_estimator import OnlineEstimate
from hexacell.campaign.task_accuracy import Task, TaskError
from hexacell.experiment_design.pose_selection import SelectedPose
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.rotations import Array

SIZES = (2, 4, 8, 16, 32)
"""How many records at a point are weighed against their time."""


@dataclass(frozen=True, slots=True)
class PointRanking:
    """Points compared.

    Attributes:
        gains_mm: what a record at each is expected to take off the worst error, mm.
        best: the point that takes most off the mean square error in its time.
    """

    gains_mm: Mapping[int, float]
    best: int


@dataclass(frozen=True, eq=False)
class Forecaster:
    """Foretells the error at the task poses.

    Attributes:
        sizes: how many records each point gets at most.
    """

    sizes: Mapping[int, int]
    budget: Budget
    task: Task
    planned_sets: PlannedSets

    def worst_error(self, known: OnlineEstimate) -> float | None:
        """The error at the worst task pose now, 1 sigma, mm."""
        error = self.task.error(known.belief)
        return None if error is None else error.worst(known.belief.covariance)

    def forecast(
        self, state: CampaignState, known: OnlineEstimate, choice: SelectedPose | None = None
    ) -> Forecast | None:
        """What a record chosen, and then going on to the end, would do; none without task poses."""
        error = self.task.error(known.belief)
        if error is None:
            return None
        now = error.worst(known.belief.covariance)
        following = now if choice is None else error.worst(_after(known.belief, choice))
        planned = self.planned(state)
        covariance = self.predicted_belief(known.belief, state).covariance
        records = sum(planned.values())
        stations = len(set(planned) - {state.point})
        # The sets foretold may tell less than the record that was really chosen.
        end = following if choice and records == 1 else min(error.worst(covariance), following)
        return Forecast(
            now_mm=now,
            next_mm=following,
            end_mm=end,
            records=records,
            minutes=self.budget.time_model.minutes(records, stations),
        )

    def planned(self, state: CampaignState) -> dict[int, int]:
        """How many more records each point will get, as far as the budget goes."""
        planned: dict[int, int] = {}
        spent, stations = len(state.measurements), state.begun_points
        for point in self._points_left(state):
            begun = state.point == point
            affordable = self.budget.records_left(spent, stations if begun else stations + 1)
            more = int(min(self.sizes[point] - state.records_at(point), affordable))
            if more < (1 if begun else 2):
                continue
            planned[point] = more
            spent, stations = spent + more, stations + (not begun)
        return planned

    def rank_points(
        self, state: CampaignState, known: OnlineEstimate, points: Sequence[int]
    ) -> PointRanking:
        """Some points compared: what records there would tell, and in what time."""
        error = self.task.error(known.belief)
        if error is None:
            return PointRanking(dict.fromkeys(points, math.inf), points[0])
        now, seen = known.belief.covariance, self.planned_sets.information_under(known.belief)
        options = {point: self._options(state, now, seen, error, point) for point in points}
        gains = {point: max((o.gain_mm for o in found), default=0.0) for point, found in options.items()}
        rates = {point: max((o.rate for o in found), default=-math.inf) for point, found in options.items()}
        return PointRanking(gains, max(points, key=rates.__getitem__))

    def _options(
        self, state: CampaignState, now: Array, seen: PlannedInformation, error: TaskError, point: int
    ) -> list[_Option]:
        """What different numbers of records at a point would do."""
        before, begun = state.records_at(point), state.point == point
        affordable = self.budget.records_left(
            len(state.measurements), state.begun_points + (0 if begun else 1)
        )
        most = int(min(self.sizes[point] - before, affordable))
        sizes = sorted({min(size, most) for size in (1, *SIZES)} - ({0} if begun else {0, 1}))
        found = []
        for size in sizes:
            then = add_information(now, _told(seen, state, point, size))
            found.append(
                _Option(
                    gain_mm=(error.worst(now) - error.worst(then)) / size,
                    rate=(error.mean_square(now) - error.mean_square(then))
                    / self.budget.time_model.minutes(size, 0 if begun else 1),
                )
            )
        return found

    def predicted_belief(self, belief: RobotBelief, state: CampaignState) -> RobotBelief:
        """What will be known once everything that is still planned is measured."""
        planned = self.planned(state).items()
        if not planned:
            return belief
        seen = self.planned_sets.information_under(belief)
        told = [_told(seen, state, point, more) for point, more in planned]
        return replace(belief, covariance=add_information(belief.covariance, np.sum(told, axis=0)))

    def _points_left(self, state: CampaignState) -> list[int]:
        left = [p for p in self.sizes if p not in state.done and p != state.point]
        return left if state.point is None else [state.point, *left]


def _after(belief: RobotBelief, choice: SelectedPose) -> Array:
    """The covariance (p, p), mm^2, after the chosen record."""
    return covariance_update(belief.covariance, choice.jacobian, choice.covariance)


def _told(seen: PlannedInformation, state: CampaignState, point: int, records: int) -> Array:
    """What more records at a point would tell; those it has count for its constant only."""
    before = state.records_at(point)
    told = seen.information(point, before + records)
    return told - seen.information(point, before) if before else told


@dataclass(frozen=True, slots=True)
class _Option:
    """Some records at a point: what they take off the worst error each, and off its square a minute."""

    gain_mm: float
    rate: float
