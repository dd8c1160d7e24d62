"""Journals that a test writes."""

from collections.abc import Iterable
from pathlib import Path

from procedures.journal.journal import Journal
from procedures.steps import events


def record(journal: Path, history: Iterable[events.Event]) -> None:
    """Append events to a journal, as a run does, or begin one with them."""
    with Journal(journal) as opened:
        for event in history:
            opened.append(event)
