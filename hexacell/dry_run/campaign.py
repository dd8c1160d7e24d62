"""A plan carried out on virtual robots, decision by decision, and what it gives: before anything moves."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from statistics import median

import numpy as np

from hexacell.campaign import decisions
from hexacell.campaign.planner import Plan
from hexacell.campaign.time_model import (
    USUAL,
    Overheads,
    Seconds,
    TimeKind,
    TimeModel,
    no_seconds,
    seconds_beside,
    speed_limits,
)
from hexacell.checks.quick_level import QuickAccuracy, QuickLevel
from hexacell.dry_run.verdict_forecast import VerdictForecast, predicted_held_out_sets, predicted_verdicts
from hexacell.errors import HexacellError, ReachError
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.motion.durations import line_duration
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.verdict.acceptance_gates import gates

MOST_TRIED = 6
"""Number of robots that are tried, where some cannot be identified."""

VisitedPose = tuple[int, int, Pose]
"""Point, orientation at it, and where that is."""


@dataclass(eq=False)
class VirtualCampaign:
    """One campaign, from the first reference to the end of the plan.

    The robot is placed at each pose; what is between is left to subclasses. Where the cell says so, the
    controller commands with the estimate once the robot is known well enough. ``outside`` is the number of
    records at which the ball left the gauges' travel; they are not taken. ``seconds`` is what it took so
    far, ``course`` the minutes and the predicted U, or error, before each record.
    """

    plan: Plan
    virtual_robot: VirtualRobot
    state: decisions.CampaignState = field(default_factory=decisions.CampaignState)
    outside: int = 0
    reason: str = ""
    seconds: Seconds = field(default_factory=no_seconds)
    course: list[tuple[float, float]] = field(default_factory=list)
    overheads: Overheads = USUAL

    @property
    def minutes(self) -> float:
        """How long it took so far."""
        return sum(self.seconds.values()) / 60.0

    @property
    def _times(self) -> TimeModel:
        return TimeModel.of(self.plan.settings, self.overheads)

    @property
    def measurements(self) -> MeasurementSet:
        """The records taken so far."""
        return self.state.measurements

    def carry_out(self) -> None:
        """Carry out all that the plan decides.

        Raises:
            HexacellError: a decision cannot be made or carried out.
        """
        while not isinstance(self.step(), decisions.Finished):
            pass

    def step(self) -> decisions.Decision:
        """Make one decision and carry it out.

        Raises:
            HexacellError: it cannot be made or carried out.
        """
        begun_s = time.process_time()
        decision = self.plan.decide(self.state)
        self.seconds[TimeKind.DECIDING] += time.process_time() - begun_s
        match decision:
            case decisions.StartPoint():
                self._pass([decision.pose])
                self._go_to_point(decision)
                self.virtual_robot.zero_gauges()
                self._measure(decision)
                times = self._times
                self.seconds[TimeKind.PLACING] += times.place_s
                self.seconds[TimeKind.MOVING] += times.trial_s
                # As to measure the noise, it leaves the first reference for pilot poses and comes back.
                reference = self.state.present
                while reference is not None and self._depart():
                    self._pass([reference])
                    self._return_to(reference)
                    self.state = replace(self.state, present=reference)
            case decisions.MeasurePose():
                if decision.forecast is not None:
                    now = decision.forecast.expanded_mm(decision.forecast.now_mm)
                    self.course.append((self.minutes, decision.forecast.now_mm if now is None else now))
                self._pass([*decision.via, decision.pose])
                self._go_to_pose(decision)
                self._measure(decision)
            case decisions.FinishPoint(point=point):
                self._finish(point, self.plan.reference_pose(point))
            case decisions.Finished(reason=reason):
                self.reason = reason
        return decision

    def _depart(self) -> bool:
        """Visit the pilot poses of one departure; whether there is any."""
        for taken in range(self.plan.pilots_per_departure):
            if (pilot := self.plan.pilot_pose(self.state)) is None:
                return taken > 0
            self._pass([*pilot.via, pilot.pose])
            self._go_to_pose(pilot)
            if (record := self._take(pilot)) is not None:
                self.state = replace(self.state, pilots=(*self.state.pilots, record))
        return True

    def _pass(self, way: Sequence[Pose]) -> None:
        """What it takes to move from where the robot is over some poses to the last of them."""
        robot, speeds = self.plan.robot, speed_limits(self.plan.settings.speed, at_gauges=True)
        for start, end in pairwise([one for one in (self.state.present, *way) if one is not None]):
            line = line_duration(robot.mechanism, robot.controller, robot.branch, start, end, speeds)
            self.seconds[TimeKind.MOVING] += line + self.overheads.move_s

    def _go_to_point(self, start: decisions.StartPoint) -> None:
        self.virtual_robot.place(start.pose)

    def _go_to_pose(self, measure: decisions.MeasurePose) -> None:
        """Go there at once, or on the planned way where a singularity lies between the two geometries."""
        try:
            self.virtual_robot.place(measure.pose)
        except ReachError:
            for pose in (*measure.via, measure.pose):
                self.virtual_robot.move(pose)

    def _return_to(self, reference: Pose) -> None:
        """Go back to the reference of the present point."""

    def _measure(self, decision: decisions.StartPoint | decisions.MeasurePose) -> None:
        if (record := self._take(decision)) is not None:
            measurements = MeasurementSet((*self.measurements.records, record))
            self.state = replace(self.state, measurements=measurements, point=decision.point)

    def _take(self, decision: decisions.StartPoint | decisions.MeasurePose) -> Record | None:
        """The record at the pose of a decision; None where the ball left the gauges' travel."""
        self.seconds[TimeKind.READING] += self._times.reading_s
        record = self.virtual_robot.measure(decision.point, decision.orientation)
        self.state = replace(self.state, present=decision.pose)
        if self.plan.robot.limits.room.holds(np.array(record.deviation)):
            return record
        self.outside += 1
        self.state = replace(self.state, rejections=self.state.rejections + 1)
        return None

    def _finish(self, point: int, reference: Pose) -> None:
        """Return to the point's reference; it is finished if nothing can be measured from there either."""
        if self.state.present != reference:
            self._pass([reference])
            self._return_to(reference)
            self.state = replace(self.state, present=reference)
            return
        done = self.state.done | {point}
        measured, pilots = self.state.measurements, self.state.pilots
        self.state = decisions.CampaignState(measured, done=done, present=reference, pilots=pilots)
        self._leave_point()

    def _leave_point(self) -> None:
        """Let the controller command with the estimate, if that is wanted and safe."""
        plan = self.plan
        is_wanted = plan.settings.identification.provisional and not plan.robot.uses_provisional
        if is_wanted and plan.allows_provisional(self.state):
            robot = plan.robot.with_provisional(plan.estimate(self.state).belief.estimate)
            self.virtual_robot.load(robot)
            self.plan = replace(plan, robot=robot)


@dataclass(frozen=True, slots=True)
class DryRunResult:
    """Medians over the robots that the plan gave enough records to identify.

    Attributes:
        drawn: number of robots that were tried.
        robots: number of robots that could be identified.
        points: number of points that are measured, with so many ``records``.
        outside: records at which the ball left the gauges' travel, over all robots.
        worst_sigma_mm: predicted error at the worst task pose afterwards; None without task poses.
        seconds: what the whole run takes of each kind, noise and held-out poses included.
        expanded_mm: U of the largest error at the task poses, systematic effects included; None without.
        verdicts: the verdicts on healthy machines; None without task poses or held-out poses.
        visited: the poses of the first of these robots, in their order, with point and orientation.
        undetermined: names of the parameters that these leave to the tolerances, by the first of them.
        course: had that run been ended earlier, its minutes and U (the error where U is not known), mm.
    """

    drawn: int
    robots: int
    points: int
    records: int
    outside: int
    worst_sigma_mm: float | None
    seconds: Seconds = field(default_factory=no_seconds)
    expanded_mm: float | None = None
    verdicts: VerdictForecast | None = None
    visited: tuple[VisitedPose, ...] = ()
    course: tuple[tuple[float, float], ...] = ()
    undetermined: tuple[str, ...] = ()

    @property
    def minutes(self) -> float:
        """How long the whole run takes."""
        return sum(self.seconds.values()) / 60.0


def dry_run(plan: Plan, overheads: Overheads = USUAL) -> DryRunResult:
    """Carry the plan out on a few robots, in a cell of these overheads; a second or two for each."""
    identified: list[_Outcome] = []
    tried = 0
    for truth in robots_within_tolerances(plan.robot, MOST_TRIED, plan.settings.identification.seed):
        if len(identified) == plan.effort.dry_run_robots:
            break
        outcome = _carry_out(plan, truth, tried, overheads)
        identified += [] if outcome is None else [outcome]
        tried += 1
    return _summary(tried, identified)


@dataclass(frozen=True, slots=True, eq=False)
class _Outcome:
    """The campaign on one robot, the error that remains, and what the run takes ``beside`` it."""

    campaign: VirtualCampaign
    forecast: decisions.Forecast | None
    budget: UncertaintyBudget | None
    verdicts: VerdictForecast | None
    beside: Seconds
    undetermined: tuple[str, ...]


def _carry_out(plan: Plan, truth: Geometry, number: int, overheads: Overheads) -> _Outcome | None:
    """The outcome for one robot; None if it is not identified, or a gate of a run would refuse it."""
    random = np.random.default_rng([plan.settings.identification.seed, number])
    campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, truth, random), overheads=overheads)
    try:
        campaign.carry_out()
        plan = campaign.plan
        estimate, forecast = plan.estimate(campaign.state), plan.forecast(campaign.state)
    except HexacellError:
        return None
    found = estimate.of_records_alone()
    if found is None or not found.problem.is_determined:
        return None
    violations = plan.robot.tolerance_violations(found.estimate)
    if any(gate.refuses for gate in gates(found.estimate, violations, residuals=found.goodness)):
        return None
    zeros, belief = plan.robot.identified_zeros(found), plan.robot.belief(found)
    belief = belief if zeros is None else replace(belief, covariance=zeros.free_covariance)
    budget = plan.task.budget(found, belief, plan.robot.effects, zeros=zeros)
    sets, times = predicted_held_out_sets(plan, found), TimeModel.of(plan.settings, overheads)
    verdicts = predicted_verdicts(plan, found, budget, sets)
    times = times.between_held_out(plan.robot, sets) if sets else times
    return _Outcome(
        campaign, forecast, budget, verdicts, seconds_beside(plan.settings, times), _names(found)
    )


def _names(found: Identification) -> tuple[str, ...]:
    """What an identification leaves to the tolerances, as people name it."""
    convention = found.problem.mechanism.convention
    return tuple(convention.display_name(name) for name in found.undetermined)


def _summary(tried: int, identified: list[_Outcome]) -> DryRunResult:
    if not identified:
        return DryRunResult(tried, 0, 0, 0, 0, None)
    points = round(median(outcome.campaign.state.begun_points for outcome in identified))
    records = round(median(len(outcome.campaign.measurements) for outcome in identified))
    errors = [outcome.forecast.now_mm for outcome in identified if outcome.forecast is not None]
    verdicts = [outcome.verdicts for outcome in identified if outcome.verdicts is not None]
    expanded = [outcome.budget.expanded_mm for outcome in identified if outcome.budget is not None]
    first, rest = identified[0].campaign, sum(identified[0].beside.values()) / 60.0
    taken = {
        kind: median(outcome.campaign.seconds[kind] + outcome.beside[kind] for outcome in identified)
        for kind in TimeKind
    }
    return DryRunResult(
        drawn=tried,
        robots=len(identified),
        points=points,
        records=records,
        outside=sum(outcome.campaign.outside for outcome in identified),
        worst_sigma_mm=median(errors) if errors else None,
        seconds=taken,
        expanded_mm=median(expanded) if expanded else None,
        verdicts=VerdictForecast.mean(verdicts) if verdicts else None,
        visited=tuple((one.point, one.orientation, one.pose) for one in first.measurements.records),
        course=tuple((minutes + rest, error) for minutes, error in first.course),
        undetermined=identified[0].undetermined,
    )


MOST_QUICKLY_TRIED = 3
"""Number of robots that are tried, where one cannot be measured."""


@dataclass(frozen=True, slots=True)
class QuickTrial:
    """What the quick level gives; ``accuracy`` is None where no robot could be measured.

    ``minutes`` is the time to measure there, without held-out poses.
    """

    accuracy: QuickAccuracy | None
    points: int = 0
    minutes: float = 0.0


def try_quick_level(quick: QuickLevel) -> QuickTrial:
    """Carry the quick level out on a robot drawn from what is known; takes a second or two."""
    plan, expected = replace(quick.plan, with_forecast=False), quick.expected
    root = np.linalg.cholesky(expected.covariance)
    for number in range(MOST_QUICKLY_TRIED):
        random = np.random.default_rng([plan.settings.identification.seed, number])
        free = expected.free + root @ random.standard_normal(len(expected.free))
        truth = plan.robot.mechanism.convention.geometry(free)
        campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, truth, random))
        try:
            campaign.carry_out()
            accuracy = quick.accuracy(campaign.measurements)
        except HexacellError:
            continue
        points = campaign.state.begun_points
        return QuickTrial(accuracy, points, campaign.minutes)
    return QuickTrial(None)
