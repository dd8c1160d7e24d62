"""Text for the screen of a cell's runs."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.application.history import PastRun
from hexacell.presentation.history import NO_RUNS, history_head, history_line
from hexacell.presentation.screens.views import HistoryEntry, HistoryView

READING = "Reading the runs of this cell ..."
WHAT_TO_PRESS = (
    "Enter  watch the chosen run again      v  compare it with the one before it",
    "b      go back to the config that it wrote; on the one in the controller: undo it",
    "o      the drift of each parameter over all runs",
)


def history_entries(runs: Sequence[PastRun]) -> tuple[HistoryEntry, ...]:
    """A line for each run, in their order."""
    return tuple(HistoryEntry(run.name, history_line(run)) for run in runs)


def history_view(entries: tuple[HistoryEntry, ...] | None, compared: tuple[str, ...]) -> HistoryView:
    """The list; ``entries`` are none before they were read."""
    if entries is None:
        return HistoryView(history_head(), (), note=READING)
    note = "" if entries else NO_RUNS
    return HistoryView(history_head(), entries, (*WHAT_TO_PRESS, "", *compared), note)


def rollback_question(run: str, *, is_in_controller: bool) -> str:
    """What a person confirms before the controller's config is changed."""
    if is_in_controller:
        return f"Undo {run}: put back the controller's config of before it?"
    return f"Go back to the controller's config that {run} wrote?"
