"""The whole job at a terminal that can show lines only: ``TERM=dumb``, as a screen reader has it."""

import re

import pytest

from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.cli.cell_folder import BY_HAND
from tests.cli.terminal import ended, start_at

pytestmark = pytest.mark.usefixtures("lines_only")
PLACED = "Press Enter when they are in place, or type a to abort: "


def test_all_abilities_of_the_screen(quick_cell, start, terminal) -> None:
    """Look at the gauges that are mounted, ask where it is, pause, undo, measure again, go on, abort."""
    quick_cell.edit(BY_HAND)
    process = start_at(terminal, start, "run", quick_cell.cell)
    terminal.read_until(PLACED)
    assert "Letters, each with Enter: p pause" in process.out
    terminal.type("g\n")
    process.wait_for("gauge z: ", lambda: process.out)
    assert re.search(r"gauge x: [+-]\d+\.\d{3} mm, \d+\.\d s ago", process.out)
    assert "from mid travel (12.5 mm)" in process.out
    terminal.read_until(PLACED)
    terminal.type("\n")
    process.wait_for("orientation 3: x ", lambda: process.out)
    terminal.type("p\n")
    process.wait_for("paused\n", lambda: process.out)
    terminal.type("s\n")
    process.wait_for("Predicted error at the task: ", lambda: process.out)
    status = process.out[process.out.index("Now: ") :]
    assert re.match(r"Now: point 1, orientation \d+.*\nDone: \d+ of \d+ records and closings", status)
    assert re.search(r"Last record: point 1, orientation \d+: x [+-]\d", status)
    terminal.type("u\nm 2\nr\n")
    process.wait_for("resumed", lambda: process.out)
    terminal.read_until(PLACED)  # at the next point: this one is complete again
    terminal.type("a\n")
    assert ended(process, terminal) == 130
    assert_plain(process, terminal)
    [run] = quick_cell.runs()
    history = read_journal(run / "journal.jsonl")
    undone = [event for event in history if isinstance(event, events.RecordDiscarded)]
    assert [event.orientation for event in undone][1:] == [2]
    records = [event for event in history if isinstance(event, events.RecordTaken)]
    assert len(re.findall(r"^\d+ of \d+: ", process.out, re.MULTILINE)) == len(records)


def assert_plain(process, terminal) -> None:
    """Nothing but lines is in it: no escape, no cursor moved back, no bell."""
    for text in (process.out, terminal.drain()):
        assert not re.search(r"[\x00-\x08\x0b-\x1f]", text.replace("\r\n", "\n"))
