"""The state of a campaign, and the next decision, by its measurement file alone."""

from __future__ import annotations

from dataclasses import replace

from hexacell.campaign.decisions import CampaignState, Finished, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.planner import Plan
from hexacell.errors import UsageError
from hexacell.measurements.records import MeasurementSet


def state_of_records(plan: Plan, measurements: MeasurementSet, *, rejections: int = 0) -> CampaignState:
    """The state after the last record: the gauges are at its point, all other points are done.

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
        return CampaignState(rejections=rejections)
    last = measurements.records[-1]
    others = frozenset(measurements.points.tolist()) - {last.point}
    return CampaignState(measurements, last.point, others, last.pose, rejections)


def decide(plan: Plan, state: CampaignState) -> StartPoint | MeasurePose | Finished:
    """What to measure now; where a point is done, at the next one.

    Raises:
        HexacellError: no geometry fits the records.
    """
    decision = plan.decide(state)
    if isinstance(decision, FinishPoint):
        leaving = replace(state, point=None, done=state.done | {decision.point}, present=None, rejections=0)
        decision = plan.decide(leaving)
    if isinstance(decision, FinishPoint):  # impossible: between points there is none to finish
        raise TypeError(decision)
    return decision
