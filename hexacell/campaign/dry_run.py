"""What a plan will give, before anything moves: the plan itself, on robots drawn from the tolerances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from hexacell.campaign.budget import TimeModel
from hexacell.campaign.decisions import CampaignState, Finished, FinishPoint
from hexacell.campaign.planner import Plan
from hexacell.errors import HexacellError
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.virtual_robot.virtual_robot import VirtualRobot, drawn_robots

ROBOTS = 2
DRAWN = 6
CANDIDATES = 128
"""Fewer than a run has: it does a little better than is foretold."""


@dataclass(frozen=True, slots=True)
class DryRunResult:
    """Medians over the robots on which the plan gave enough records to identify them.

    Attributes:
        robots: how many these are, of those ``drawn`` to find them.
        points: that were measured, and how many ``records`` there.
        outside: records at which the ball left the gauges' travel, over all robots.
        worst_sigma_mm: the error at the worst task pose afterwards; none without task poses.
        minutes: to measure, held-out poses included.
    """

    drawn: int
    robots: int
    points: int
    records: int
    outside: int
    worst_sigma_mm: float | None
    minutes: float


def dry_run(plan: Plan, robots: int | None = None) -> DryRunResult:
    """Carry the plan out on a few robots, ``ROBOTS`` by default. Takes a second or two for each."""
    wanted = ROBOTS if robots is None else robots
    quick = replace(plan, candidates=min(plan.candidates, CANDIDATES))
    ended: list[_Ended] = []
    drawn = 0
    for truth in drawn_robots(plan.robot, DRAWN, plan.settings.identification.seed):
        if len(ended) == wanted:
            break
        found = _carried_out(quick, truth, drawn)
        ended += [] if found is None else [found]
        drawn += 1
    return _summary(plan, drawn, ended)


@dataclass(frozen=True, slots=True)
class _Ended:
    """A campaign that could identify its robot."""

    points: int
    records: int
    outside: int
    worst_sigma_mm: float | None


def _carried_out(plan: Plan, truth: Geometry, number: int) -> _Ended | None:
    random = np.random.default_rng([plan.settings.identification.seed, number])
    try:
        state, outside = _Campaign(plan, VirtualRobot(plan.robot, truth), random).carried_out()
        estimate, outlook = plan.estimate(state).identification, plan.forecast(state)
    except HexacellError:
        return None
    if estimate is None or not is_determined(estimate.problem):
        return None
    worst = None if outlook is None else outlook.now_mm
    return _Ended(state.begun_points, len(state.measurements), outside, worst)


def _summary(plan: Plan, drawn: int, ended: list[_Ended]) -> DryRunResult:
    if not ended:
        return DryRunResult(drawn, 0, 0, 0, 0, None, 0.0)
    points = round(median(one.points for one in ended))
    records = round(median(one.records for one in ended))
    errors = [one.worst_sigma_mm for one in ended if one.worst_sigma_mm is not None]
    held_out = plan.settings.verification
    in_line = TimeModel.of(plan.settings, moves=1.0)
    judging = in_line.minutes(len(held_out.points) * held_out.orientations, len(held_out.points))
    return DryRunResult(
        drawn=drawn,
        robots=len(ended),
        points=points,
        records=records,
        outside=sum(one.outside for one in ended),
        worst_sigma_mm=median(errors) if errors else None,
        minutes=plan.budget.time_model.minutes(records, points) + 2.0 * judging,
    )


@dataclass(eq=False)
class _Campaign:
    """A plan that is carried out on a robot without hardware."""

    plan: Plan
    built: VirtualRobot
    random: np.random.Generator

    def carried_out(self) -> tuple[CampaignState, int]:
        """Where it ends, and how many records could not be taken.

        Raises:
            HexacellError: a decision could not be made.
        """
        state, outside = CampaignState(), 0
        for now in self._steps():
            state, outside = now, outside + (now.refusals > state.refusals)
        return state, outside

    def _steps(self) -> Iterator[CampaignState]:
        state = CampaignState()
        zero: Array | None = None
        while not isinstance(decision := self.plan.decide(state), Finished):
            reference = None if state.point is None else self.plan.reference_pose(state.point)
            if isinstance(decision, FinishPoint) and state.present != reference:
                # Sets are closed at their reference, and another way may lead on from there.
                state = replace(state, present=reference)
            elif isinstance(decision, FinishPoint):
                done = state.done | {decision.point}
                state, zero = CampaignState(state.measurements, done=done), None
            else:
                label = (decision.point, decision.orientation)
                record, shown = self.built.measured(label, decision.pose, zero, self.random)
                zero = shown if zero is None else zero
                state = self._after(state, record, decision.pose)
            yield state

    def _after(self, state: CampaignState, record: Record, command: Pose) -> CampaignState:
        outside = np.abs(record.deviation).max() > self.plan.robot.limits.gauge_travel_mm
        if outside:
            return replace(state, present=command, refusals=state.refusals + 1)
        records = (*state.measurements.records, record)
        same = state.point == record.point
        return CampaignState(
            MeasurementSet(records),
            record.point,
            state.done,
            command,
            state.refusals if same else 0,
        )
