"""Text for the runs of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from hexacell.presentation.screens.headers import MODES
from hexacell.presentation.screens.views import HistoryEntry, HistoryView
from procedures.run import events

HISTORY_HEADER = "begun (UTC)           kind         result"
READING = "Reading the runs of this cell ..."
NO_RUNS = "This cell has no runs yet."
COMPARE = "v compares the run that is chosen with the one before it; b puts back the config of before it."


def history_view(entries: tuple[HistoryEntry, ...] | None, compared: tuple[str, ...]) -> HistoryView:
    """The list; ``entries`` are none before they were read."""
    if entries is None:
        return HistoryView(HISTORY_HEADER, (), note=READING)
    note = "" if entries else NO_RUNS
    return HistoryView(HISTORY_HEADER, entries, compared or (COMPARE,), note)


def history_line(history: Sequence[events.Event], begun: datetime) -> str:
    """A run in a line: when it was begun, what it was, and what came of it."""
    started = next((event for event in history if isinstance(event, events.RunStarted)), None)
    ended = next((event for event in history if isinstance(event, events.Ended)), None)
    judged = next((event for event in history if isinstance(event, events.ResultValidated)), None)
    kind = MODES[started.mode] if started else "?"
    result = "interrupted; a start resumes the latest one" if ended is None else ended.line
    verdict = f"{judged.verdict.upper()}: " if judged else ""
    return f"{begun:%Y-%m-%d %H:%M:%S}   {kind:13}{verdict}{result}"
