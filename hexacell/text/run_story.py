"""A recorded run told in lines: when what happened."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from hexacell.text.events import EventFormatter
from hexacell.text.layout import COLUMNS
from hexacell.text.line_face import record_text
from procedures.journal.line_format import Entry
from procedures.run.state import RunState, apply
from procedures.steps import events

INDENT = 10
"""Columns of the time."""


def run_story(entries: Iterable[Entry]) -> Iterator[tuple[Entry, str]]:
    """The events that a person is told of, each with its text, which may have several lines."""
    formatter, state = EventFormatter(), RunState()
    for entry in entries:
        state = apply(state, entry.event)
        lines = [*_own_words(entry.event), *formatter.lines(entry.event, state)]
        if lines:
            yield entry, "\n".join(lines)


def story_text(entries: Iterable[Entry]) -> str:
    """The same as text, each with its time, UTC."""
    told = (f"{entry.at:%H:%M:%S}  {_indented(text)}" for entry, text in run_story(entries))
    return "\n".join(told)


def _own_words(event: events.Event) -> list[str]:
    """What nobody need be told while it happens."""
    match event:
        case events.RunStarted():
            return [f"{event.mode} of {event.cell}, {event.software}"]
        case events.RecordTaken():
            return [record_text(event)]
        case events.Interrupted(reason=reason):
            return [f"interrupted: {reason}"]
        case events.Ended(line=line):
            return [line]
        case _:
            return []


def _indented(text: str) -> str:
    lines = (textwrap.fill(line, COLUMNS - INDENT, subsequent_indent="  ") for line in text.splitlines())
    return "\n".join(lines).replace("\n", "\n" + " " * INDENT)
