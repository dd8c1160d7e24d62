"""``hexacell fit``: a geometry from a measurement file."""

from __future__ import annotations

import argparse

from hexacell.cell.file import load_cell
from hexacell.cli.console import Console
from hexacell.cli.words import identification_words
from hexacell.errors import ExitCode
from hexacell.identification.estimate import identify
from hexacell.measurement_file import read_measurements
from hexacell.robot import robot_of
from hexacell.summary import identification_document


def main(options: argparse.Namespace) -> ExitCode:
    """Identify, and say all that is known of the result."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    robot = robot_of(cell)
    found = identify(robot.problem(read_measurements(options.measurements)))
    console.document(identification_document(found))
    if not options.json:
        console.say(identification_words(found, robot.drawing))
    return ExitCode.DONE if found.converged else ExitCode.OUT_OF_LIMITS
