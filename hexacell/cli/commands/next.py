"""``hexacell next``: the pose worth measuring next, for people whose controller we do not drive."""

from __future__ import annotations

import argparse
from typing import Any

from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.campaign.from_file import decide, state_of_records
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.measurements.csv_file import read_measurements
from hexacell.presentation.layout import wrapped
from hexacell.presentation.planning import outlook_words, visit_words
from hexacell.robot_model import robot_of


def main(options: argparse.Namespace) -> ExitCode:
    """Decide on the records so far."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    plan = Plan(cell.settings, robot_of(cell), pose_list_of(cell))
    measurements = read_measurements(options.measurements, allow_partial=True)
    state = state_of_records(plan, measurements, refusals=options.refused)
    decision = decide(plan, state)
    outlook = decision.forecast if isinstance(decision, MeasurePose) else plan.forecast(state)
    console.document(next_document(decision, outlook))
    if not options.json:
        console.say(wrapped(visit_words(decision)))
        console.say(wrapped(outlook_words(outlook)))
    return ExitCode.DONE


def next_document(
    decision: StartPoint | MeasurePose | Finished, outlook: Forecast | None
) -> dict[str, Any]:
    """The document of ``docs/interface.md``."""
    now = None if outlook is None else outlook.now_mm
    if isinstance(decision, Finished):
        return {"done": True, "reason": decision.reason, "present_worst_sigma_mm": now}
    return {
        "done": False,
        "point": decision.point,
        **_step(decision),
        "pose": dict(zip("xyzabc", decision.pose.as_tuple(), strict=True)),
        "joint_targets": list(decision.joints),
        "present_worst_sigma_mm": now,
        "predicted_worst_sigma_mm": None if outlook is None else outlook.next_mm,
        "going_on": None if outlook is None else _going_on(outlook),
    }


def _step(decision: StartPoint | MeasurePose) -> dict[str, Any]:
    if isinstance(decision, StartPoint):
        zero = [0.0, 0.0, 0.0]
        return {
            "orientation": 1,
            "reference": True,
            "predicted_deviation": zero,
            "sigma": zero,
            "gain": 0.0,
            "via": [],
        }
    return {
        "orientation": decision.orientation,
        "reference": False,
        "predicted_deviation": list(decision.deviation),
        "sigma": list(decision.sigma),
        "gain": decision.gain,
        "via": [dict(zip("xyzabc", pose.as_tuple(), strict=True)) for pose in decision.via],
    }


def _going_on(outlook: Forecast) -> dict[str, Any]:
    return {
        "records": outlook.records,
        "minutes": outlook.minutes,
        "worst_sigma_mm": outlook.end_mm,
        "gain_mm": outlook.gain_mm,
    }
