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
from hexacell.campaign.pose_chooser import Chooser
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
    listed: PoseList | None = None
    candidates: int = CANDIDATES
    foretelling: bool = True

    def decide(self, situation: CampaignState) -> Decision:
        """What to do now.

        Raises:
            HexacellError: the records cannot be understood.
        """
        if situation.point is None:
            return self._between_points(situation)
        if not situation.records_at(situation.point):
            return self._reference(situation.point)
        return self._at_point(situation, situation.point)

    def known(self, situation: CampaignState) -> OnlineEstimate:
        """What the records so far say of the robot.

        Raises:
            IdentifiabilityError: they do not belong to it.
        """
        return self._tracker.known(situation.measurements)

    def may_lend(self, situation: CampaignState) -> bool:
        """Whether the robot is known well enough for the controller to command with the estimate."""
        found = self.known(situation)
        if found.estimate is None:
            return False
        stand = ReachableTargets(found.estimate.poses[[-1]], found.estimate.problem.joints[[-1]])
        return orientation_sigma(found.knowledge, stand) <= LENT_TURN

    def outlook(self, situation: CampaignState) -> Forecast | None:
        """What going on would gain; none where there are no task poses."""
        return self._forecaster.outlook(situation, self.known(situation))

    def planned(self, situation: CampaignState) -> dict[int, int]:
        """How many more records each point will get, as far as the budget goes."""
        return self._forecaster.planned(situation)

    def predicted_belief(self) -> RobotBelief:
        """What will be known at the end, if the robot is as drawn."""
        return self._forecaster.predicted_belief(self.robot.knowledge(), CampaignState())

    def poses_at(self, point: int) -> tuple[Pose, ...]:
        """Those poses of a point that are given beforehand, its reference first; chosen ones are not."""
        if self.listed is not None:
            return self.listed.at(point)
        return (Pose(*self.settings.identification.points[point - 1]),)

    def records_at(self, point: int) -> int:
        """How many records a point gets at most, its reference included."""
        if self.listed is not None:
            return len(self.listed.at(point))
        return self.settings.identification.orientations

    def reference_pose(self, point: int) -> Pose:
        """Where a point's gauges are zeroed, in the controller's frames."""
        return self.poses_at(point)[0]

    @property
    def points(self) -> range:
        """All points, as people count them."""
        return range(1, len(self.settings.identification.points) + 1)

    @cached_property
    def chooser(self) -> Chooser:
        """Which pose is next at a point."""
        return Chooser(self.settings, self.robot, self.listed, self.task, self.candidates)

    @cached_property
    def budget(self) -> Budget:
        """What may be spent."""
        return Budget.of(self.settings)

    @cached_property
    def task(self) -> Task:
        """Where the robot has to be accurate."""
        return Task.of(self.settings, self.robot)

    @cached_property
    def prospect(self) -> PlannedSets:
        """What whole points would tell."""
        if self.listed is not None:
            return PlannedSets(tuple(map(self.chooser.held, self.listed.poses)))
        plan = self.settings.identification
        balls = self.chooser.held(Pose(*point) for point in plan.points).positions
        return PlannedSets.spread(self.robot.knowledge(), balls, plan.orientations, plan.seed)

    @cached_property
    def _tracker(self) -> OnlineEstimator:
        return OnlineEstimator(self.robot)

    @cached_property
    def _forecaster(self) -> Forecaster:
        sizes = {point: self.records_at(point) for point in self.points}
        return Forecaster(sizes, self.budget, self.task, self.prospect)

    def _between_points(self, situation: CampaignState) -> Decision:
        left = [point for point in self.points if point not in situation.done]
        if all(situation.records_at(point) >= self.records_at(point) for point in self.points):
            return Finished(f"all {len(self.points)} points are measured")
        if reason := self._budget_used(situation, 1, 2) or self._target_reached(situation):
            return Finished(reason)
        if not left:
            return Finished(f"all {len(self.points)} points are measured as far as they could be")
        left = [point for point in left if self._can_stand_at(situation, point)]
        if not left:
            return Finished("the robot cannot stand safely at the points that are left")
        plan = self.settings.identification
        if plan.least_gain_mm or plan.choose_points:
            worth = self._forecaster.worth(situation, self.known(situation), left)
            left = [point for point in left if worth.gains_mm[point] >= plan.least_gain_mm]
            if plan.choose_points and worth.best in left:
                left = [worth.best]
        if not left:
            return Finished(f"no record would gain {plan.least_gain_mm:g} mm at the task poses")
        return self._reference(left[0])

    def _at_point(self, situation: CampaignState, point: int) -> Decision:
        if reason := self._reason_to_leave(situation, point):
            return FinishPoint(point, reason)
        try:
            visit = self._visit(situation, point)
        except LimitError as error:
            return FinishPoint(point, error.problem)
        least = self.settings.identification.least_gain_mm
        if visit.outlook is not None and visit.outlook.now_mm - visit.outlook.next_mm < least:
            return FinishPoint(point, f"no record here would gain {least:g} mm at the task poses")
        return visit

    def _reason_to_leave(self, situation: CampaignState, point: int) -> str | None:
        """Why nothing more is to be measured at the present point, whatever pose could be chosen."""
        if situation.records_at(point) >= self.records_at(point):
            return f"all its {self.records_at(point)} orientations are measured"
        if situation.refusals > REFUSALS:
            return f"the ball left the gauges' travel {situation.refusals} times"
        return (
            self._budget_used(situation, 0, 1)
            or self._target_reached(situation)
            or self._better_elsewhere(situation, point)
        )

    def _budget_used(self, situation: CampaignState, stations: int, records: int) -> str | None:
        """The reason to stop where some more points and records cannot be paid."""
        left = self.budget.left(len(situation.measurements), situation.stations + stations)
        return None if left >= records else f"the budget of {self.budget.words} is used"

    def _target_reached(self, situation: CampaignState) -> str | None:
        """The reason to stop that the accuracy gives, if it is reached."""
        target = self.settings.identification.target_mm
        if target is None or not len(situation.measurements):
            return None
        known = self.known(situation)
        if known.estimate is None or not is_determined(known.estimate.problem):
            return None
        worst = self._forecaster.worst(known)
        if worst is None or worst > target:
            return None
        return f"the predicted error at the task poses is {worst:.3f} mm, within {target:g}"

    def _better_elsewhere(self, situation: CampaignState, point: int) -> str | None:
        """The reason to leave that another point gives, if points are to be chosen."""
        left = [other for other in self.points if other not in situation.done and other != point]
        if not self.settings.identification.choose_points or not left:
            return None
        worth = self._forecaster.worth(situation, self.known(situation), [point, *left])
        return None if worth.best == point else f"point {worth.best} tells more in the same time"

    def _visit(self, situation: CampaignState, point: int) -> MeasurePose:
        known = self.known(situation)
        choice, via = self.chooser.choose_with_path(known.knowledge, known.station(point), situation)
        base = self.robot.change.base.T
        covariance = base @ np.diag(choice.sigma**2) @ base.T
        return MeasurePose(
            point=point,
            orientation=situation.records_at(point) + 1,
            pose=self.robot.to_command(choice.command),
            joints=joints_of(choice.joints),
            deviation=_three(base @ choice.deviation),
            sigma=_three(np.sqrt(np.diag(covariance))),
            gain=choice.gain,
            outlook=self._forecaster.outlook(situation, known, choice) if self.foretelling else None,
            via=via,
        )

    def _can_stand_at(self, situation: CampaignState, point: int) -> bool:
        """Whether the robot, as it is known by now, stands at a point clear of singularities."""
        if not len(situation.measurements):
            return True  # by the drawing it does: that was seen in preflight
        reference = self.chooser.held([self.reference_pose(point)])
        try:
            knowledge = self.known(situation).knowledge
        except IdentifiabilityError:
            return True  # what is wrong with the records is said where the geometry is identified
        return is_clear(knowledge, reference, reference)

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
