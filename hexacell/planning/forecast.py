"""What a plan will give, before anything moves: the plan itself, on robots drawn from the tolerances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from hexacell.errors import HexacellError
from hexacell.geometry import Geometry
from hexacell.identification.refusals import is_enough
from hexacell.measurements import MeasurementSet, Record
from hexacell.planning.budget import Pace
from hexacell.planning.plan import Plan
from hexacell.planning.robots import Built, drawn_robots
from hexacell.planning.situation import ClosePoint, Finished, Situation
from hexacell.pose import Pose
from hexacell.rotations import Array

ROBOTS = 2
DRAWN = 6
CANDIDATES = 128
"""Fewer than a run has: it does a little better than is foretold."""


@dataclass(frozen=True, slots=True)
class Foretold:
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


def foretell(plan: Plan, robots: int | None = None) -> Foretold:
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
        situation, outside = _Campaign(plan, Built(plan.robot, truth), random).carried_out()
        estimate, outlook = plan.known(situation).estimate, plan.outlook(situation)
    except HexacellError:
        return None
    if estimate is None or not is_enough(estimate.problem):
        return None
    worst = None if outlook is None else outlook.now_mm
    return _Ended(situation.stations, len(situation.measurements), outside, worst)


def _summary(plan: Plan, drawn: int, ended: list[_Ended]) -> Foretold:
    if not ended:
        return Foretold(drawn, 0, 0, 0, 0, None, 0.0)
    points = round(median(one.points for one in ended))
    records = round(median(one.records for one in ended))
    errors = [one.worst_sigma_mm for one in ended if one.worst_sigma_mm is not None]
    held_out = plan.settings.verification
    in_line = Pace.of(plan.settings, moves=1.0)
    judging = in_line.minutes(len(held_out.points) * held_out.orientations, len(held_out.points))
    return Foretold(
        drawn=drawn,
        robots=len(ended),
        points=points,
        records=records,
        outside=sum(one.outside for one in ended),
        worst_sigma_mm=median(errors) if errors else None,
        minutes=plan.budget.pace.minutes(records, points) + 2.0 * judging,
    )


@dataclass(eq=False)
class _Campaign:
    """A plan that is carried out on a robot without hardware."""

    plan: Plan
    built: Built
    random: np.random.Generator

    def carried_out(self) -> tuple[Situation, int]:
        """Where it ends, and how many records could not be taken.

        Raises:
            HexacellError: a decision could not be made.
        """
        situation, outside = Situation(), 0
        for now in self._steps():
            situation, outside = now, outside + (now.refusals > situation.refusals)
        return situation, outside

    def _steps(self) -> Iterator[Situation]:
        situation = Situation()
        zero: Array | None = None
        while not isinstance(decision := self.plan.decide(situation), Finished):
            reference = None if situation.point is None else self.plan.reference_pose(situation.point)
            if isinstance(decision, ClosePoint) and situation.present != reference:
                # Sets are closed at their reference, and another way may lead on from there.
                situation = replace(situation, present=reference)
            elif isinstance(decision, ClosePoint):
                done = situation.done | {decision.point}
                situation, zero = Situation(situation.measurements, done=done), None
            else:
                label = (decision.point, decision.orientation)
                record, shown = self.built.measured(label, decision.pose, zero, self.random)
                zero = shown if zero is None else zero
                situation = self._after(situation, record, decision.pose)
            yield situation

    def _after(self, situation: Situation, record: Record, command: Pose) -> Situation:
        outside = np.abs(record.deviation).max() > self.plan.robot.limits.gauge_travel_mm
        if outside:
            return replace(situation, present=command, refusals=situation.refusals + 1)
        records = (*situation.measurements.records, record)
        same = situation.point == record.point
        return Situation(
            MeasurementSet(records),
            record.point,
            situation.done,
            command,
            situation.refusals if same else 0,
        )
