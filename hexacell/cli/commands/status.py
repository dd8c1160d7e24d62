"""``hexacell status``: cells at a glance, and their metrics for a monitoring system."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from hexacell.cell.loader import is_cell_file
from hexacell.cli.commands.cell import archive_url, cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, FileError, HexacellError, UsageError
from hexacell.services.history.cell_status import CellStatus, cell_status, fleet_cells, publish_status
from hexacell.storage.atomic_files import write_atomically
from hexacell.text.cells import fleet_text, metrics_text, status_document, status_text


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Show the cells; nothing is changed but the file of metrics, which is replaced whole."""
    if not options.cells:
        return _fleet(options, console)
    if options.archive is not None:
        raise UsageError("--archive is for all of its cells", action="Name no cell, or leave it away")
    found, unreadable = _all(options.cells, console)
    for one in found:
        try:
            publish_status(one)
        except FileError as error:
            console.warn(" ".join(str(error).split()))
    if options.metrics is not None:
        write_atomically(options.metrics, metrics_text(found).encode(), for_everybody=True)
    broken = [{"cell": path, "error": str(error)} for path, error in unreadable.items()]
    document = {"cells": [status_document(one) for one in found], "unreadable": broken}
    console.show(document, status_text(found, unreadable))
    return ExitCode.USAGE if unreadable else ExitCode.DONE


def _all(paths: Sequence[Path], console: Console) -> tuple[list[CellStatus], dict[Path, HexacellError]]:
    """Every cell; one that is broken hides no other. What a pattern names beside them is left out."""
    found: list[CellStatus] = []
    unreadable: dict[Path, HexacellError] = {}
    for path in paths:
        if len(paths) > 1 and not is_cell_file(path):
            continue
        try:
            found.append(cell_status(cell_at(path, console)))
        except HexacellError as error:
            if len(paths) == 1:
                raise
            unreadable[path] = error
    return found, unreadable


def _fleet(options: argparse.Namespace, console: Console) -> ExitCode:
    if options.archive is None:
        raise UsageError("no cell is named", action="Name cell files, or --archive URL for all")
    if options.metrics is not None:
        raise UsageError("metrics are of cells of this computer", action="Name their cell files")
    found = fleet_cells(archive_url(options.archive))
    cells = [one.model_dump(mode="json") | {"overdue": one.is_overdue} for one in found]
    console.show({"cells": cells}, fleet_text(found))
    return ExitCode.DONE
