"""Text for the screen of a cell's runs."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.services.history.history import PastRun
from hexacell.text.history import NO_RUNS, history_head, history_line
from hexacell.text.screens.questions import PERSON
from hexacell.text.screens.views import Choice, HistoryEntry, HistoryView, QuestionView

PROPOSAL_WAITS = "Its proposal can still be written: w asks for it, with the change."
READING = "Reading the runs of this cell ..."
WHAT_TO_PRESS = (
    "Enter  watch the chosen run again      v  compare it with the one before it",
    "b      go back to the config that it wrote; if the controller has it: undo it",
    "w      write its proposal, where it has one, into the controller's config",
    "o      the drift of each parameter over all runs",
)


def history_entries(runs: Sequence[PastRun]) -> tuple[HistoryEntry, ...]:
    """A line for each run, in their order."""
    return tuple(HistoryEntry(run.name, history_line(run), run.summary.has_proposal) for run in runs)


def history_view(entries: tuple[HistoryEntry, ...] | None, compared: tuple[str, ...]) -> HistoryView:
    """The list; ``entries`` are none before they were read."""
    if entries is None:
        return HistoryView(history_head(), (), note=READING)
    note = "" if entries else NO_RUNS
    return HistoryView(history_head(), entries, (*WHAT_TO_PRESS, "", *compared), note)


def rollback_question(run: str, *, is_in_controller: bool) -> QuestionView:
    """What a person confirms before the controller's config is changed."""
    title = f"Go back to the controller's config that {run} wrote?"
    if is_in_controller:
        title = f"Undo {run}: put back the controller's config of before it?"
    consent = Choice("y", "yes, replace the config, bit for bit", PERSON, is_consent=True)
    return QuestionView(title, (), "Press y or n.", (consent, Choice("n", "no, leave it as it is", None)))
