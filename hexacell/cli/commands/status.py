"""``hexacell status``: cells at a glance, and their metrics for a monitoring system."""

from __future__ import annotations

import argparse

from hexacell.application.cell_status import cell_status
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.presentation.cell_status import metrics_text, status_document, status_text
from hexacell.storage.atomic_files import write_atomically


def main(options: argparse.Namespace) -> ExitCode:
    """Tell; nothing is changed but the file of metrics, which is replaced whole."""
    console = Console(options.json)
    found = [cell_status(cell_at(path, console)) for path in options.cells]
    if options.metrics is not None:
        write_atomically(options.metrics, metrics_text(found).encode())
    console.document(status_document(found))
    console.print(status_text(found))
    return ExitCode.DONE
