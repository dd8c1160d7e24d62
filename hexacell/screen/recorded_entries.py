"""The runs of a cell as its history lists them."""

from __future__ import annotations

from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.presentation.screens.history import history_line
from hexacell.presentation.screens.views import HistoryEntry
from hexacell.runs.run_folder import RunFolder, runs_folder
from procedures.journal.journal import read_entries


def recorded_entries(cell: Cell) -> tuple[HistoryEntry, ...]:
    """A line for each run, the latest first; one that cannot be read says why."""
    folder = runs_folder(cell)
    names = sorted((path for path in folder.iterdir()), reverse=True) if folder.is_dir() else []
    runs = [RunFolder(path) for path in names]
    return tuple(HistoryEntry(run.path.name, _line(run)) for run in runs if run.journal.is_file())


def _line(run: RunFolder) -> str:
    try:
        entries = read_entries(run.journal)
    except HexacellError as error:
        return f"{run.path.name:22}{error.problem}"
    return history_line([entry.event for entry in entries], entries[0].at) if entries else run.path.name
