"""``hexacell fit``: identifies the geometry from a measurement file."""

from __future__ import annotations

import argparse

from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.identification.estimator import identify
from hexacell.measurements.csv_file import read_measurements
from hexacell.presentation.identification import identification_report
from hexacell.reporting.assessment import assess
from hexacell.reporting.documents import assessment_document, identification_document
from hexacell.robot_model import robot_of


def main(options: argparse.Namespace) -> ExitCode:
    """Identify and report all that is known of the result."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    robot = robot_of(cell)
    measurements = read_measurements(options.measurements)
    found = identify(robot.problem(measurements))
    assessed = assess(cell.settings, robot, measurements, found)
    console.document(identification_document(found) | assessment_document(found, assessed))
    if not options.json:
        console.print(identification_report(found, robot.drawing, assessed))
    usable = found.converged and not assessed.refused
    return ExitCode.DONE if usable else ExitCode.OUT_OF_LIMITS
