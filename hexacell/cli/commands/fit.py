"""``hexacell fit``: identifies the geometry from a measurement file."""

from __future__ import annotations

import argparse

from hexacell.application.fit import fit_measurements
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.measurements.csv_file import read_measurements
from hexacell.presentation.identification import identification_report
from hexacell.reporting.documents import fit_document


def main(options: argparse.Namespace) -> ExitCode:
    """Identify and report all that is known of the result."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    result = fit_measurements(cell, read_measurements(options.measurements))
    console.document(fit_document(result.identified, result.assessed))
    if not options.json:
        console.print(identification_report(result))
    return ExitCode.DONE if result.is_usable else ExitCode.OUT_OF_LIMITS
