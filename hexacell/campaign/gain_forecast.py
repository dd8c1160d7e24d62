"""Forecast of the gain of further records, for display and for the choice of points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

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

SET_SIZES = (2, 4, 8, 16, 32)
"""Numbers of records at a point whose gain is compared with their time."""


@dataclass(frozen=True, slots=True)
class PointRanking:
    """Points compared.

    Attributes:
        gains_mm: what a record at each point is expected to take off the worst error, mm.
        best: the point that takes most off the mean square error per minute.
    """

    gains_mm: Mapping[int, float]
    best: int


@dataclass(frozen=True, eq=False)
class Forecaster:
    """Forecasts the error at the task poses.

    Attributes:
        sizes: how many records each point gets at most.
        select_sets: gives sets that represent the poses not selected yet; called once, when needed.
    """

    sizes: Mapping[int, int]
    budget: Budget
    task: Task
    select_sets: Callable[[], PlannedSets]

    @cached_property
    def planned_sets(self) -> PlannedSets:
        """The sets of poses that forecasts are made with."""
        return self.select_sets()

    def worst_error(self, estimate: OnlineEstimate) -> float | None:
        """The error at the worst task pose now, 1 sigma, mm; none without task poses."""
        error = self.task.error(estimate.belief)
        return None if error is None else error.worst(estimate.belief.covariance)

    def forecast(
        self, state: CampaignState, estimate: OnlineEstimate, selected: SelectedPose | None = None
    ) -> Forecast | None:
        """The effect of a selected record and of completing the plan; None without task poses."""
        belief = estimate.belief
        error = self.task.error(belief)
        if error is None:
            return None
        now = after = error.worst(belief.covariance)
        if selected is not None:
            after = error.worst(
                covariance_update(belief.covariance, selected.jacobian, selected.covariance)
            )
        planned = self.planned(state)
        end = error.worst(self.predicted_belief(belief, state).covariance)
        records = sum(planned.values())
        begun_later = len(set(planned) - {state.point})
        return Forecast(
            now_mm=now,
            next_mm=after,
            # The planned sets may give less information than the record actually selected.
            end_mm=after if selected and records == 1 else min(end, after),
            records=records,
            minutes=self.budget.time_model.minutes(records, begun_later),
        )

    def planned(self, state: CampaignState) -> dict[int, int]:
        """How many more records each point will get, as far as the budget goes."""
        planned: dict[int, int] = {}
        records, points = len(state.measurements), state.begun_points
        for point in self._points_left(state):
            is_begun = state.point == point
            affordable = self.budget.records_left(records, points if is_begun else points + 1)
            more = int(min(self.sizes[point] - state.records_at(point), affordable))
            if more < (1 if is_begun else 2):
                continue
            planned[point] = more
            records, points = records + more, points + (not is_begun)
        return planned

    def rank_points(
        self, state: CampaignState, estimate: OnlineEstimate, points: Sequence[int]
    ) -> PointRanking:
        """Compare what records at some points would gain, and in what time."""
        error = self.task.error(estimate.belief)
        if error is None:
            return PointRanking(dict.fromkeys(points, math.inf), points[0])
        covariance = estimate.belief.covariance
        information = self.planned_sets.information_under(estimate.belief)
        options = {point: self._options(state, covariance, information, error, point) for point in points}
        gains = {point: max((o.gain_mm for o in found), default=0.0) for point, found in options.items()}
        rates = {point: max((o.rate for o in found), default=-math.inf) for point, found in options.items()}
        return PointRanking(gains, max(points, key=rates.__getitem__))

    def predicted_belief(self, belief: RobotBelief, state: CampaignState) -> RobotBelief:
        """What will be known once everything that is still planned is measured."""
        planned = self.planned(state).items()
        if not planned:
            return belief
        information = self.planned_sets.information_under(belief)
        added = [_added(information, state, point, more) for point, more in planned]
        return replace(belief, covariance=add_information(belief.covariance, np.sum(added, axis=0)))

    def _options(
        self,
        state: CampaignState,
        covariance: Array,
        information: PlannedInformation,
        error: TaskError,
        point: int,
    ) -> list[_Option]:
        """What different numbers of records at a point would do."""
        is_begun = state.point == point
        points = state.begun_points + (0 if is_begun else 1)
        affordable = self.budget.records_left(len(state.measurements), points)
        most = int(min(self.sizes[point] - state.records_at(point), affordable))
        sizes = sorted({min(size, most) for size in (1, *SET_SIZES)} - ({0} if is_begun else {0, 1}))
        options = []
        for size in sizes:
            after = add_information(covariance, _added(information, state, point, size))
            minutes = self.budget.time_model.minutes(size, 0 if is_begun else 1)
            gain = (error.worst(covariance) - error.worst(after)) / size
            rate = (error.mean_square(covariance) - error.mean_square(after)) / minutes
            options.append(_Option(gain, rate))
        return options

    def _points_left(self, state: CampaignState) -> list[int]:
        left = [point for point in self.sizes if point not in state.done and point != state.point]
        return left if state.point is None else [state.point, *left]


def _added(information: PlannedInformation, state: CampaignState, point: int, records: int) -> Array:
    """What more records at a point would add; those it has count for its zero only."""
    before = state.records_at(point)
    added = information.information(point, before + records)
    return added - information.information(point, before) if before else added


@dataclass(frozen=True, slots=True)
class _Option:
    """Some records at a point: what each takes off the worst error, and off the mean square a minute."""

    gain_mm: float
    rate: float
