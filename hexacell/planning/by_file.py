"""Where a campaign stands, by its measurement file alone."""

from __future__ import annotations

from dataclasses import replace

from hexacell.errors import UsageError
from hexacell.measurements import MeasurementSet
from hexacell.planning.plan import Plan
from hexacell.planning.situation import ClosePoint, Finished, Reference, Situation, Visit


def situation_of(plan: Plan, measurements: MeasurementSet, *, refusals: int = 0) -> Situation:
    """The situation after the last record: the gauges stand at its point, all others are done.

    Raises:
        UsageError: a record is of a point that the plan does not have.
    """
    for point in measurements.points.tolist():
        if point not in plan.points:
            raise UsageError(
                f"there are records of point {point}, but the cell file has {len(plan.points)} points",
                action="Take the measurement file and the cell file that belong together",
            )
    if not len(measurements):
        return Situation(refusals=refusals)
    last = measurements.records[-1]
    others = frozenset(measurements.points.tolist()) - {last.point}
    return Situation(measurements, last.point, others, last.pose, refusals)


def decide(plan: Plan, situation: Situation) -> Reference | Visit | Finished:
    """What to measure now; a point that is done is left for the next one.

    Raises:
        HexacellError: the records cannot be understood.
    """
    decision = plan.decide(situation)
    if isinstance(decision, ClosePoint):
        leaving = replace(
            situation, point=None, done=situation.done | {decision.point}, present=None, refusals=0
        )
        decision = plan.decide(leaving)
    if isinstance(decision, ClosePoint):  # between points there is none to close
        raise TypeError(decision)
    return decision
