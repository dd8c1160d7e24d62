"""A recorded run told in lines."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from hexacell.text.line_face import run_story, story_text
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.story import Story

NOON = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)
HISTORY = [
    *Story(SetKey(phase=Phase.AFTER, point=10)).whole(11),
    events.Interrupted(reason="a cable of the third encoder broke", exit_code=3),
    events.Resumed(),
    events.Ended(exit_code=0, line="35 parameters, 55 records at 5 points; " + "position error " * 8),
]
ENTRIES = [
    Entry(n, NOON + timedelta(seconds=n), float(n), event) for n, event in enumerate(HISTORY, start=1)
]


def test_each_record_and_each_turn_has_its_time() -> None:
    told = list(run_story(ENTRIES))
    kinds = [entry.event.kind for entry, _ in told]
    assert kinds == ["sampled"] * 11 + ["closed", "interrupted", "resumed", "ended"]
    lines = story_text(ENTRIES).splitlines()
    assert lines[0] == "12:00:03  held-out point 10, after, orientation 1: x +0.000, y +0.000, z +0.000"
    assert lines[1] == "            mm"
    assert "12:00:26  interrupted: a cable of the third encoder broke" in lines
    assert max(map(len, lines)) <= 80
