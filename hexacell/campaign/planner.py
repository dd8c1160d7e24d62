"""The plan of a campaign: what to measure next, decided on the records so far and nothing else.

Points one after the other, each with a reference where the gauges are zeroed and orientations that
choose themselves from what is known by then, until the error at the task poses is small enough, the
budget is used, or nothing is left that is worth measuring.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.campaign.budget import Budget
from hexacell.campaign.decisions import (
    CampaignState,
    Decision,
    Finished,
    FinishPoint,
    Forecast,
    MeasurePose,
    StartPoint,
    Three,
)
from hexacell.campaign.gain_forecast import Forecaster
from hexacell.campaign.information_forecast import PlannedSets
from hexacell.campaign.pose_chooser import PoseChooser
from hexacell.campaign.pose_list import PoseList
from hexacell.campaign.recursive_estimator import OnlineEstimate, OnlineEstimator
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.errors import IdentifiabilityError, LimitError
from hexacell.experiment_design.candidates import ReachableTargets
from hexacell.experiment_design.travel_monte_carlo import orientation_sigma
from hexacell.identification.belief import RobotBelief
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Joints
from hexacell.motion.path_check import is_clear
from hexacell.robot_model import Robot

CANDIDATES = 1024
LENT_TURN = float(np.radians(2.0))
"""Uncertainty of the platform's orientation, rad, beyond which no geometry is lent: after a whole point
it is below one degree, after two records seven."""

REFUSALS = 3
"""Records of one point that may leave the travel before the point is given up."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of one cell.

    Attributes:
        listed: poses to visit; none where they are to be chosen.
        candidates: among how many orientations the next one is chosen.
        foretelling: whether to say of every record what it will gain at the task poses.
    """

    settings: CellSettings
    robot: Robot
    pose_list: PoseList | None = None
    candidates: int = CANDIDATES
    with_forecast: bool = True

    def decide(self, state: CampaignState) -> Decision:
        """What to do now.

        Raises:
            HexacellError: the records cannot be understood.
        """
        if state.point is None:
            return self._between_points(state)
        if not state.records_at(state.point):
            return self._reference(state.point)
        return self._at_point(state, state.point)

    def estimate(self, state: CampaignState) -> OnlineEstimate:
        """What the records so far say of the robot.

        Raises:
            IdentifiabilityError: they do not belong to it.
        """
        return self._tracker.estimate(state.measurements)

    def allows_provisional(self, state: CampaignState) -> bool:
        """Whether the robot is known well enough for the controller to command with the estimate."""
        found = self.estimate(state)
        if found.identification is None:
            return False
        stand = ReachableTargets(
            found.identification.poses[[-1]], found.identification.problem.joints[[-1]]
        )
        return orientation_sigma(found.belief, stand) <= LENT_TURN

    def forecast(self, state: CampaignState) -> Forecast | None:
        """What going on would gain; none where there are no task poses."""
        return self._forecaster.forecast(state, self.estimate(state))

    def planned(self, state: CampaignState) -> dict[int, int]:
        """How many more records each point will get, as far as the budget goes."""
        return self._forecaster.planned(state)

    def predicted_belief(self) -> RobotBelief:
        """What will be known at the end, if the robot is as drawn."""
        return self._forecaster.predicted_belief(self.robot.belief(), CampaignState())

    def poses_at(self, point: int) -> tuple[Pose, ...]:
        """Those poses of a point that are given beforehand, its reference first; chosen ones are not."""
        if self.pose_list is not None:
            return self.pose_list.at(point)
        return (Pose(*self.settings.identification.points[point - 1]),)

    def records_at(self, point: int) -> int:
        """How many records a point gets at most, its reference included."""
        if self.pose_list is not None:
            return len(self.pose_list.at(point))
        return self.settings.identification.orientations

    def reference_pose(self, point: int) -> Pose:
        """Where a point's gauges are zeroed, in the controller's frames."""
        return self.poses_at(point)[0]

    @property
    def points(self) -> range:
        """All points, as people count them."""
        return range(1, len(self.settings.identification.points) + 1)

    @cached_property
    def chooser(self) -> PoseChooser:
        """Which pose is next at a point."""
        return PoseChooser(self.settings, self.robot, self.pose_list, self.task, self.candidates)

    @cached_property
    def budget(self) -> Budget:
        """What may be spent."""
        return Budget.of(self.settings)

    @cached_property
    def task(self) -> Task:
        """Where the robot has to be accurate."""
        return Task.of(self.settings, self.robot)

    @cached_property
    def planned_sets(self) -> PlannedSets:
        """What whole points would tell."""
        if self.pose_list is not None:
            return PlannedSets(tuple(map(self.robot.from_commands, self.pose_list.poses)))
        plan = self.settings.identification
        balls = self.robot.from_commands(Pose(*point) for point in plan.points).positions
        return PlannedSets.select(self.robot.belief(), balls, plan.orientations, plan.seed)

    @cached_property
    def _tracker(self) -> OnlineEstimator:
        return OnlineEstimator(self.robot)

    @cached_property
    def _forecaster(self) -> Forecaster:
        sizes = {point: self.records_at(point) for point in self.points}
        return Forecaster(sizes, self.budget, self.task, self.planned_sets)

    def _between_points(self, state: CampaignState) -> Decision:
        left = [point for point in self.points if point not in state.done]
        if all(state.records_at(point) >= self.records_at(point) for point in self.points):
            return Finished(f"all {len(self.points)} points are measured")
        if reason := self._budget_used(state, 1, 2) or self._target_reached(state):
            return Finished(reason)
        if not left:
            return Finished(f"all {len(self.points)} points are measured as far as they could be")
        left = [point for point in left if self._can_stand_at(state, point)]
        if not left:
            return Finished("the robot cannot stand safely at the points that are left")
        plan = self.settings.identification
        if plan.least_gain_mm or plan.choose_points:
            worth = self._forecaster.rank_points(state, self.estimate(state), left)
            left = [point for point in left if worth.gains_mm[point] >= plan.least_gain_mm]
            if plan.choose_points and worth.best in left:
                left = [worth.best]
        if not left:
            return Finished(f"no record would gain {plan.least_gain_mm:g} mm at the task poses")
        return self._reference(left[0])

    def _at_point(self, state: CampaignState, point: int) -> Decision:
        if reason := self._reason_to_leave(state, point):
            return FinishPoint(point, reason)
        try:
            visit = self._visit(state, point)
        except LimitError as error:
            return FinishPoint(point, error.problem)
        least = self.settings.identification.least_gain_mm
        if visit.forecast is not None and visit.forecast.now_mm - visit.forecast.next_mm < least:
            return FinishPoint(point, f"no record here would gain {least:g} mm at the task poses")
        return visit

    def _reason_to_leave(self, state: CampaignState, point: int) -> str | None:
        """Why nothing more is to be measured at the present point, whatever pose could be chosen."""
        if state.records_at(point) >= self.records_at(point):
            return f"all its {self.records_at(point)} orientations are measured"
        if state.refusals > REFUSALS:
            return f"the ball left the gauges' travel {state.refusals} times"
        return (
            self._budget_used(state, 0, 1)
            or self._target_reached(state)
            or self._better_elsewhere(state, point)
        )

    def _budget_used(self, state: CampaignState, stations: int, records: int) -> str | None:
        """The reason to stop where some more points and records cannot be paid."""
        left = self.budget.records_left(len(state.measurements), state.begun_points + stations)
        return None if left >= records else f"the budget of {self.budget.description} is used"

    def _target_reached(self, state: CampaignState) -> str | None:
        """The reason to stop that the accuracy gives, if it is reached."""
        target = self.settings.identification.target_mm
        if target is None or not len(state.measurements):
            return None
        known = self.estimate(state)
        if known.identification is None or not is_determined(known.identification.problem):
            return None
        worst = self._forecaster.worst_error(known)
        if worst is None or worst > target:
            return None
        return f"the predicted error at the task poses is {worst:.3f} mm, within {target:g}"

    def _better_elsewhere(self, state: CampaignState, point: int) -> str | None:
        """The reason to leave that another point gives, if points are to be chosen."""
        left = [other for other in self.points if other not in state.done and other != point]
        if not self.settings.identification.choose_points or not left:
            return None
        worth = self._forecaster.rank_points(state, self.estimate(state), [point, *left])
        return None if worth.best == point else f"point {worth.best} tells more in the same time"

    def _visit(self, state: CampaignState, point: int) -> MeasurePose:
        known = self.estimate(state)
        choice, via = self.chooser.choose_with_path(known.belief, known.gauge_zero(point), state)
        base = self.robot.frames.base.T
        covariance = base @ np.diag(choice.sigma**2) @ base.T
        return MeasurePose(
            point=point,
            orientation=state.records_at(point) + 1,
            pose=self.robot.to_command(choice.command),
            joints=joints_of(choice.joints),
            deviation=_three(base @ choice.deviation),
            sigma=_three(np.sqrt(np.diag(covariance))),
            gain=choice.gain,
            forecast=self._forecaster.forecast(state, known, choice) if self.with_forecast else None,
            via=via,
        )

    def _can_stand_at(self, state: CampaignState, point: int) -> bool:
        """Whether the robot, as it is known by now, stands at a point clear of singularities."""
        if not len(state.measurements):
            return True  # by the drawing it does: that was seen in preflight
        reference = self.robot.from_commands([self.reference_pose(point)])
        try:
            belief = self.estimate(state).belief
        except IdentifiabilityError:
            return True  # what is wrong with the records is said where the geometry is identified
        return is_clear(belief, reference, reference)

    def _reference(self, point: int) -> StartPoint:
        pose = self.reference_pose(point)
        poses = PoseBatch.of([pose])
        joints = self.robot.mechanism.inverse(self.robot.controller, self.robot.branch, poses)
        return StartPoint(point, pose, joints_of(joints[0]))


def joints_of(values: Array) -> Joints:
    """Joint variables (6,) as plain numbers."""
    q1, q2, q3, q4, q5, q6 = (float(value) for value in values)
    return q1, q2, q3, q4, q5, q6


def _three(values: Array) -> Three:
    x, y, z = (float(value) for value in values)
    return x, y, z
