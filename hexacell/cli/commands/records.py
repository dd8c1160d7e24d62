"""``hexacell fit`` and ``hexacell next``: what the records in a measurement file say."""

import argparse
from typing import Any

from hexacell.campaign.decisions import Finished, StartPoint
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.measurements.csv_file import read_measurements
from hexacell.measurements.records import MeasurementSet
from hexacell.runs.run_folder import RunFolder
from hexacell.services.offline import MOST_RECORDS_BEFORE_NEXT, NextPose, fit_measurements, next_pose
from hexacell.text.identification import identification_report
from hexacell.text.layout import wrapped
from hexacell.text.planning import decision_text, forecast_text, left_out_text
from hexacell.verdict.fit_document import fit_document

MANY_RECORDS = 200


def fit(options: argparse.Namespace, console: Console) -> ExitCode:
    """Identify the geometry and report all that is known of the result."""
    cell = cell_at(options.cell, console)
    folder = RunFolder(options.measurements.parent)
    measurements = read_measurements(options.measurements)
    _print_size(console, measurements)
    choice = None if options.identify is None else ParameterChoice(options.identify)
    assessed = fit_measurements(cell, measurements, folder, choice)
    console.document(fit_document(assessed))
    if not options.json:
        console.print(identification_report(assessed))
    return ExitCode.DONE if assessed.is_usable else ExitCode.OUT_OF_LIMITS


def propose_next(options: argparse.Namespace, console: Console) -> ExitCode:
    """Propose the pose worth measuring next, for controllers that hexacell does not drive."""
    cell = cell_at(options.cell, console)
    measurements = read_measurements(options.measurements, allow_partial=True)
    if len(measurements) <= MOST_RECORDS_BEFORE_NEXT:
        _print_size(console, measurements)
    proposed = next_pose(cell, measurements, rejections=options.refused)
    console.document(_next_document(proposed))
    if not options.json:
        lines = (
            decision_text(proposed.decision),
            forecast_text(proposed.forecast),
            left_out_text(proposed.left_out),
        )
        for line in filter(None, lines):
            console.print(wrapped(line))
    return ExitCode.DONE


def _next_document(proposed: NextPose) -> dict[str, Any]:
    decision, forecast = proposed.decision, proposed.forecast
    now = {
        "left_out": proposed.left_out,
        "present_worst_sigma_mm": forecast and forecast.now_mm,
        "present_expanded_mm": forecast and forecast.expanded_mm(forecast.now_mm),
    }
    if isinstance(decision, Finished):
        return {"done": True, "reason": decision.reason, **now}
    if isinstance(decision, StartPoint):
        zero = [0.0, 0.0, 0.0]
        found = {"predicted_deviation": zero, "sigma": zero, "gain": 0.0, "via": []}
        record = {"orientation": 1, "reference": True, **found}
    else:
        record = {
            "orientation": decision.orientation,
            "reference": False,
            "predicted_deviation": decision.deviation,
            "sigma": decision.sigma,
            "gain": decision.gain,
            "via": decision.via,
        }
    return {
        "done": False,
        **now,
        "point": decision.point,
        **record,
        "pose": decision.pose,
        "joint_targets": decision.joints,
        "predicted_worst_sigma_mm": forecast and forecast.next_mm,
        "going_on": forecast
        and {
            "records": forecast.records,
            "minutes": forecast.minutes,
            "worst_sigma_mm": forecast.end_mm,
            "expanded_mm": forecast.expanded_mm(forecast.end_mm),
            "gain_mm": forecast.gain_mm,
        },
    }


def _print_size(console: Console, measurements: MeasurementSet) -> None:
    """Announce what takes more than a few seconds before it begins."""
    if len(measurements) > MANY_RECORDS:
        console.error(f"{len(measurements)} records: this takes some {len(measurements) // 50} seconds")
