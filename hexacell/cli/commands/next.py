"""``hexacell next``: the pose worth measuring next, for controllers that hexacell does not drive."""

from __future__ import annotations

import argparse

from hexacell.application.planning import next_pose
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.measurements.csv_file import read_measurements
from hexacell.presentation.documents import next_document
from hexacell.presentation.layout import wrapped
from hexacell.presentation.planning import next_pose_text


def main(options: argparse.Namespace) -> ExitCode:
    """Propose a pose from the records so far."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    measurements = read_measurements(options.measurements, allow_partial=True)
    proposed = next_pose(cell, measurements, rejections=options.refused)
    console.document(next_document(proposed))
    if not options.json:
        for line in next_pose_text(proposed):
            console.print(wrapped(line))
    return ExitCode.DONE
