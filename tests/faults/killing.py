"""Killing a run, and going on as its user would."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.faults.cell import Site
from tests.faults.promises import require_tidy, require_valid, whole_lines
from tests.faults.steps import step_of

KILLED = -9


def history_of(site: Site) -> Sequence[events.Event]:
    """What the latest run's journal says; a torn end says nothing."""
    return read_journal(site.runs()[-1].journal) if site.runs() else ()


def finish(program: Any, site: Site, *, code: int = 0) -> None:
    """Do what the user of a killed run does: resume it, or begin anew where nothing was begun."""
    at_the_kill = {run.journal: run.journal.read_bytes() for run in site.runs()}
    begun = bool(history_of(site))
    ended = program.resume(site) if site.runs() else program.run(site)
    if site.runs() and not begun and at_the_kill:
        assert (ended.code, "Begin a new run" in ended.words) == (2, True), ended.words
        [empty] = site.runs()
        empty.journal.unlink()
        ended = program.run(site)
    for journal, content in at_the_kill.items():
        assert not whole_lines(content) or journal.read_bytes().startswith(whole_lines(content))
    over = "is over" in ended.words
    assert ended.code == (2 if over else code), ended.words
    require_valid(site.run())
    require_tidy(site)


def places(history: Sequence[events.Event]) -> dict[str, int]:
    """How many records a run has when each kind of step begins for the first time."""
    first: dict[str, int] = {}
    for number, event in enumerate(history, start=1):
        if isinstance(event, events.StepBegun):
            first.setdefault(step_of(history[:number]), number)
    return first


def after(records: int) -> dict[str, int]:
    return {"die_after_records": records}


def within(record: int) -> dict[str, int]:
    return {"tear_record": record}
