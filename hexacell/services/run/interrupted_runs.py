"""The runs of a cell that were interrupted and can be resumed."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError, UsageError
from hexacell.runs.run_folder import RunFolder, find_run, runs_folder
from procedures.journal.journal import read_entries
from procedures.journal.line_format import Entry
from procedures.run import events

LATEST = "latest"
"""In the place of a run's name."""


def run_to_resume(cell: Cell, named: str) -> RunFolder:
    """A run by its folder or name, or the interrupted one in which something happened last.

    Raises:
        UsageError: there is none.
    """
    return _latest(cell) if named == LATEST else find_run(cell, named)


def _latest(cell: Cell) -> RunFolder:
    folder = runs_folder(cell)
    runs = [RunFolder(path) for path in folder.iterdir()] if folder.is_dir() else []
    interrupted = {run: entries[-1].at for run in runs if (entries := _entries_if_interrupted(run))}
    if not interrupted:
        raise UsageError(
            "no run of this cell was interrupted", action=f"Name one; the cell's runs are in {folder}"
        )
    return max(interrupted, key=interrupted.__getitem__)


def _entries_if_interrupted(run: RunFolder) -> Sequence[Entry]:
    """The journal of a run that is not over; nothing where it cannot be read."""
    if not run.journal.is_file():
        return []
    try:
        entries = read_entries(run.journal)
    except HexacellError:
        return []
    is_over = any(isinstance(entry.event, events.Ended) for entry in entries)
    return [] if is_over else entries
