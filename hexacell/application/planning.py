"""Questions to a cell's plan without a run: the next pose, and a trial on simulated robots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.campaign.dry_run import DryRunResult, dry_run
from hexacell.campaign.feasibility import unreachable_share
from hexacell.campaign.from_file import decide, state_of_records
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import Cell
from hexacell.measurements.records import MeasurementSet
from hexacell.robot_model import robot_of


@dataclass(frozen=True, slots=True)
class NextPose:
    """What to measure next; ``forecast`` is absent where the robot can take no task pose."""

    decision: StartPoint | MeasurePose | Finished
    forecast: Forecast | None


@dataclass(frozen=True, slots=True)
class PlanTrial:
    """A plan carried out on simulated robots.

    Attributes:
        unreachable: share of the robots within the tolerances that cannot reach a point, by point.
        target_mm: predicted error at which measuring ends, if the cell file states one.
    """

    result: DryRunResult
    unreachable: Mapping[int, float]
    target_mm: float | None


def next_pose(cell: Cell, measurements: MeasurementSet, *, rejections: int = 0) -> NextPose:
    """The pose worth measuring after these records.

    Args:
        cell: the robot, its tolerances, limits and points.
        measurements: the records so far; may be empty.
        rejections: poses at the present point that could not be measured.

    Raises:
        HexacellError: the records do not belong to this cell, or no geometry fits them.
    """
    plan = _plan_of(cell)
    state = state_of_records(plan, measurements, rejections=rejections)
    decision = decide(plan, state)
    forecast = decision.forecast if isinstance(decision, MeasurePose) else plan.forecast(state)
    return NextPose(decision, forecast)


def try_plan(cell: Cell) -> PlanTrial:
    """Carry out a cell's plan on robots drawn within its tolerances; takes some seconds."""
    plan = _plan_of(cell)
    return PlanTrial(dry_run(plan), unreachable_share(plan), cell.settings.identification.target_mm)


def _plan_of(cell: Cell) -> Plan:
    return Plan(cell.settings, robot_of(cell), pose_list_of(cell))
