"""The plan of a campaign: what to measure next, decided on the records so far and nothing else.

Points are measured one after the other. At each the gauges are zeroed at a reference, and poses are
selected by what is known by then, until the error at the task poses is small enough, the budget is used,
or nothing is left that is worth measuring.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hexacell.campaign import decisions
from hexacell.campaign.budget import Budget, paid_sizes, shared_sizes
from hexacell.campaign.forecast import Forecaster, PlannedInformation, select_sets
from hexacell.campaign.online_estimate import OnlineEstimate, OnlineEstimator, RecordEstimator
from hexacell.campaign.pilots import CAUTION, FIRST_PILOT, MOST_PILOTS, MOST_TO_A_LIST, pilots_per_departure
from hexacell.campaign.pose_chooser import PoseChooser, is_well_known
from hexacell.campaign.pose_list import PoseList
from hexacell.campaign.stopping_rules import Goal, StoppingRules
from hexacell.campaign.task_accuracy import Task, planned_budget
from hexacell.campaign.time_model import TimeModel
from hexacell.cell.model import CellSettings
from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort
from hexacell.errors import IdentifiabilityError, LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import deviation_of, joints_of
from hexacell.motion.path_check import stands_within_limits
from hexacell.motion.paths import find_route
from hexacell.robot.model import Robot
from hexacell.uncertainty.budget import UncertaintyBudget

PROVISIONAL_SIGMA = float(np.radians(2.0))
"""Standard deviation of the platform's orientation, rad, beyond which the controller does not command
with the estimate: after a whole point it is below one degree, after two records seven."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of one cell.

    Attributes:
        pose_list: poses to visit; None where they are to be selected.
        effort: how hard poses are searched for.
        with_forecast: whether to forecast for every record what it gains at the task poses.
        estimator: estimates the robot from the records; None for the usual one.
        goal: what the records are for; None to identify the geometry as well as the settings ask for.
        earlier: what the systematic effects did to an earlier result that is the prior, by their names.
        most_turned: the largest angle from a point's reference to a selected pose, rad, by the estimate.
    """

    settings: CellSettings
    robot: Robot
    pose_list: PoseList | None = None
    effort: SearchEffort = USUAL_EFFORT
    with_forecast: bool = True
    estimator: RecordEstimator | None = None
    goal: Goal | None = None
    earlier: Mapping[str, Array] = field(default_factory=dict)
    most_turned: float = np.pi

    def decide(self, state: decisions.CampaignState) -> decisions.Decision:
        """What to do now. Raises ``HexacellError``: no geometry fits the records."""
        if state.point is None:
            return self._between_points(state)
        if not state.records_at(state.point):
            return self._start(state.point)
        return self._at_point(state, state.point)

    def estimate(self, state: decisions.CampaignState) -> OnlineEstimate:
        """The estimate of the robot from the records so far.

        Raises:
            IdentifiabilityError: they do not belong to it.
        """
        return self._estimator(state.steering)

    def pilot_pose(self, state: decisions.CampaignState) -> decisions.MeasurePose | None:
        """Where to read the gauges next, only to steer the choice of poses; None where that is not wanted.

        It is wanted at the first point, while the robot leaves the reference to measure its noise, as long
        as little is known of it.

        Raises:
            HexacellError: no geometry fits the records.
        """
        point, is_first = state.point, len(state.measurements) == 1
        most = MOST_PILOTS if self.pose_list is None else MOST_TO_A_LIST
        most = min(most, self.settings.noise.revisits * self.pilots_per_departure)
        is_enough = len(state.pilots) >= most or state.rejections > 0
        if point is None or not is_first or is_enough or self.goal is not None:
            return None
        cautious = self.cautious
        estimate = cautious.estimate(state)
        try:
            if is_well_known(estimate.belief, estimate.gauge_zero(point)):
                return None
            return replace(cautious._next_pose(state, point), orientation=FIRST_PILOT + len(state.pilots))
        except LimitError:
            return None

    @property
    def pilots_per_departure(self) -> int:
        """At how many pilot poses the gauges are read before the robot comes back to the reference."""
        return pilots_per_departure(self.pose_list is not None)

    @cached_property
    def cautious(self) -> "Plan":
        """This plan before the noise is measured, which may be larger than stated; poses are not listed."""
        robot, effort = replace(self.robot, noise=self.robot.noise.scaled(CAUTION)), self.effort
        listed = self.pose_list.at(self.points[0]) if self.pose_list is not None else ()
        return replace(
            self,
            robot=robot,
            pose_list=None,
            effort=replace(effort, candidates=min(effort.candidates, effort.pilot_candidates)),
            estimator=None,
            with_forecast=False,
            most_turned=max((listed[0].angle_to(pose) for pose in listed), default=np.pi),
        )

    def allows_provisional(self, state: decisions.CampaignState) -> bool:
        """Whether the robot is known well enough for the controller to command with the estimate.

        A controller whose own geometry is as good, as after a calibration, keeps it.
        """
        estimate = self.estimate(state)
        found, belief = estimate.identification, estimate.belief
        if found is None:
            return False
        if belief.orientation_sigma(found.poses[[-1]], found.problem.joints[[-1]]) > PROVISIONAL_SIGMA:
            return False
        # Whether the geometry that commands errs by more at the task poses than the estimate may.
        error, change = self.task.error(belief), belief.free - self.robot.free_parameters
        return error is None or error.largest(change) > error.worst(belief.covariance)

    def forecast(self, state: decisions.CampaignState) -> decisions.Forecast | None:
        """The gain of further records; None without task poses."""
        return self.forecaster.forecast(state, self.estimate(state).belief)

    def predicted_belief(self) -> RobotBelief:
        """What will be known at the end, if the robot is as drawn."""
        return self.forecaster.predicted_belief(self.robot.belief(), decisions.CampaignState())

    def poses_at(self, point: int) -> tuple[Pose, ...]:
        """The poses of a point that are given beforehand, its reference first."""
        if self.pose_list is not None:
            return self.pose_list.at(point)
        return (Pose(*self.settings.identification.points[point - 1]),)

    def records_at(self, point: int) -> int:
        """How many records a point gets at most, its reference included."""
        listed = self.pose_list
        return self.settings.identification.orientations if listed is None else len(listed.at(point))

    def sizes(self, state: decisions.CampaignState) -> Mapping[int, int]:
        """How many records each point gets at most, once some points were found to be out of reach.

        What a file lists, a goal needs, or points gain in the same time, is not shared. A budget in minutes
        decides how many the points get that are not done.
        """
        planned = {point: self.records_at(point) for point in self.points}
        is_shared = self.pose_list is None and self.goal is None
        if not is_shared or self.settings.identification.choose_points:
            return planned
        left = self._out_of_reach(state)
        if self.budget.minutes is not None:
            return paid_sizes(planned, state, left, self.budget, self.times(state))
        return shared_sizes(planned, state, left)

    def times(self, state: decisions.CampaignState) -> TimeModel:
        """How long measuring takes, by the ways between the records so far."""
        last, records = self._last_times, state.measurements.records
        if not last or last[0][0] is not records:
            last[:] = [(records, TimeModel.of(self.settings).after(self.robot, records))]
        return last[0][1]

    @cached_property
    def _last_times(self) -> list[tuple[object, TimeModel]]:
        """The last answer, if there was one, after the records that it is by."""
        return []

    def reference_pose(self, point: int) -> Pose:
        """Where a point's gauges are zeroed, in the controller's frames."""
        return self.poses_at(point)[0]

    def route(self, state: decisions.CampaignState, start: Pose, end: Pose) -> tuple[Pose, ...] | None:
        """Level poses by way of which clear lines lead from one pose to another; None if there are none.

        Poses are in the controller's frames. The gauges are not at the ball.
        """
        via = (start.level, end.level)
        first, last, *others = (self.robot.from_commands([pose]) for pose in (start, end, *via))
        rows = find_route(self.estimate(state).belief, first, last, others)
        return None if rows is None else tuple(via[row] for row in rows)

    @property
    def points(self) -> tuple[int, ...]:
        """The points that are measured, counted from 1 among all of the cell."""
        every = range(1, len(self.settings.identification.points) + 1)
        return tuple(point for point in every if point not in self.settings.excluded_points)

    @cached_property
    def chooser(self) -> PoseChooser:
        """Chooses the next pose at a point."""
        known_then = None if self.goal else self.forecaster.known_beside_next
        return PoseChooser(
            self.settings, self.robot, self.pose_list, self.task, self.effort, known_then, self.most_turned
        )

    @cached_property
    def budget(self) -> Budget:
        """What may be spent."""
        return Budget.of(self.settings)

    @cached_property
    def task(self) -> Task:
        """Where the robot has to be accurate."""
        return Task.of(self.settings, self.robot, self.robot.belief())

    @cached_property
    def planned_sets(self) -> tuple[PoseBatch, ...]:
        """A set of poses at each point, as a forecast of those that will be selected."""
        if self.pose_list is not None:
            return tuple(map(self.robot.from_commands, self.pose_list.poses))
        plan = self.settings.identification
        balls = self.robot.from_commands(Pose(*point) for point in plan.points).positions
        return select_sets(
            self.robot.belief(), balls, plan.orientations, plan.seed, self.effort.planned_candidates
        )

    def information_per_record(self, belief: RobotBelief) -> Array:
        """The information (p, p), 1/mm^2, of a record of the planned sets on average.

        Beside what is known of terms, whose coefficients take their part of it.
        """
        information = PlannedInformation.of(self.planned_sets, belief)
        sizes = {point: len(self.planned_sets[point - 1]) for point in self.points}
        total = np.sum([information.information(point, size) for point, size in sizes.items()], axis=0)
        mean: Array = total / sum(sizes.values())
        if belief.terms is None:
            return mean
        free = len(belief.free)
        of_terms = mean[free:, free:] + np.linalg.inv(belief.terms.covariance)
        return mean[:free, :free] - mean[:free, free:] @ np.linalg.solve(of_terms, mean[free:, :free])

    @cached_property
    def forecaster(self) -> Forecaster:
        """Forecasts what further records gain."""
        return Forecaster(
            self.sizes,
            self.times,
            self.budget,
            self.task,
            lambda: self.planned_sets,
            self.robot.from_commands,
            lambda: self.systematic_mm,
        )

    @cached_property
    def planned_budget(self) -> UncertaintyBudget | None:
        """The uncertainty at the end, systematic effects included; None where it is not known."""
        sets = [self.planned_sets[point - 1] for point in self.points]
        return planned_budget(self.robot, self.task, sets, self.earlier)

    @property
    def systematic_mm(self) -> float | None:
        """Standard uncertainty by the systematic effects at the end; None where it is not known."""
        if not any(effect.size for effect in self.robot.effects):
            return 0.0
        return None if self.planned_budget is None else self.planned_budget.systematic_mm

    @cached_property
    def _last_out_of_reach(self) -> list[tuple[object, frozenset[int]]]:
        """The last answer, if there was one, after what it depends on."""
        return []

    @cached_property
    def _estimator(self) -> RecordEstimator:
        return self.estimator or OnlineEstimator(self.robot).estimate

    @cached_property
    def _stopping(self) -> StoppingRules:
        return StoppingRules(self.settings, self.forecaster, self._estimator, self.goal)

    def _between_points(self, state: decisions.CampaignState) -> decisions.Decision:
        if reason := self._stopping.end_of_campaign(state):
            return decisions.Finished(reason)
        safe = self._safe(state, [point for point in self.points if point not in state.done])
        if not safe:
            return decisions.Finished("none of the remaining points can be reached safely")
        points = self._reachable(state, safe) or safe
        if not self.settings.identification.choose_points:
            return self._start(points[0])
        return self._start(self.forecaster.best_point(state, self.estimate(state).belief, points))

    def _at_point(self, state: decisions.CampaignState, point: int) -> decisions.Decision:
        if reason := self._stopping.end_of_point(state, point):
            return decisions.FinishPoint(point, reason)
        try:
            return self._next_pose(state, point)
        except LimitError as error:
            return decisions.FinishPoint(point, error.problem)

    def _next_pose(self, state: decisions.CampaignState, point: int) -> decisions.MeasurePose:
        estimate = self.estimate(state)
        belief = estimate.belief.zeroed_at(state.zero_mm)
        selected, via = self.chooser.choose(belief, estimate.gauge_zero(point), state)
        base, record = self.robot.frames.base.T, selected.record
        return decisions.MeasurePose(
            point=point,
            orientation=state.records_at(point) + 1,
            pose=self.robot.to_command(selected.command),
            joints=joints_of(record.targets.joints[0]),
            deviation=deviation_of(base @ record.deviation[0]),
            sigma=deviation_of(np.hypot(record.sigma, record.chance)[0]),
            gain=selected.gain,
            forecast=self.forecaster.forecast(state, belief, selected) if self.with_forecast else None,
            via=via,
        )

    def _out_of_reach(self, state: decisions.CampaignState) -> frozenset[int]:
        """Points that are not to be begun as far as is known.

        A point that is only too uncertain may be measured later, if there is another one to learn from.
        """
        last, progress = self._last_out_of_reach, (state.measurements.records, state.done, state.point)
        if not last or last[0][0] != progress:
            others = [point for point in self.points if point not in state.done and point != state.point]
            safe = self._safe(state, others)
            unsafe = [point for point in others if point not in safe]
            possible = [] if unsafe == others else self._safe(state, unsafe, certainly=False)
            last[:] = [(progress, frozenset(unsafe) - frozenset(possible))]
        return last[0][1]

    def _safe(
        self, state: decisions.CampaignState, points: list[int], *, certainly: bool = True
    ) -> list[int]:
        """The points whose reference the robot, as it is known by now, takes within the limits.

        With ``certainly`` false, only as the estimate has it.
        """
        if not points or not len(state.measurements):
            return points  # by the drawing it does, as preflight has checked
        try:
            belief = self.estimate(state).belief
        except IdentifiabilityError:
            return points  # the identification reports what is wrong with the records
        references = self.robot.from_commands(map(self.reference_pose, points))
        stands = stands_within_limits(belief, references, certainly=certainly)
        return [point for point, is_safe in zip(points, stands, strict=True) if is_safe]

    def _reachable(self, state: decisions.CampaignState, points: list[int]) -> list[int]:
        """The points to which clear lines lead from the present pose; all where that is unknown.

        While little is known of the robot, some lines may be too near a limit that are clear later.
        """
        here = state.present
        if here is None or not len(state.measurements):
            return points
        try:
            routes = {point: self.route(state, here, self.reference_pose(point)) for point in points}
        except IdentifiabilityError:
            return points  # the identification reports what is wrong with the records
        return [point for point, route in routes.items() if route is not None]

    def _start(self, point: int) -> decisions.StartPoint:
        robot, pose = self.robot, self.reference_pose(point)
        joints = robot.mechanism.inverse(robot.controller, robot.branch, PoseBatch.of([pose]))
        return decisions.StartPoint(point, pose, joints_of(joints[0]))
