"""A run in a process of its own at plain terminals: left, come back to, taken over, and lost."""

from __future__ import annotations

import os
import pty
import re
import signal

import pytest

from hexacell.cell.loader import load_cell
from procedures.journal.journal import read_journal
from procedures.run import events
from tests.cli.cell_folder import BY_HAND
from tests.cli.terminal import Terminal, ended, start_at
from tests.cli.test_host import nothing_is_left
from tests.waiting import wait_until

PLACED = "Press Enter when they are in place, or type a to abort: "


@pytest.fixture
def cell(quick_cell, tmp_path, monkeypatch):
    runtime = tmp_path / "r"
    runtime.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setenv("TMPDIR", str(runtime))
    quick_cell.edit(BY_HAND)
    return quick_cell


@pytest.fixture
def terminals():
    opened = [Terminal(*pty.openpty()) for _ in range(3)]
    yield opened
    for one in opened:
        os.close(one.master)
        os.close(one.slave)


def history(cell):
    [run] = cell.runs()
    return read_journal(run / "journal.jsonl")


def test_left_and_come_back_to(cell, start, terminals) -> None:
    first, second, _ = terminals
    beginning = start_at(first, start, "run", cell.cell, "--detachable")
    beginning.wait_for("You are in control of this run.", lambda: beginning.out)
    first.read_until(PLACED)
    first.type("g\n")
    beginning.wait_for("gauge z: ", lambda: beginning.out)
    first.read_until(PLACED)
    first.type("\n")
    beginning.wait_for("3 of 61: point 1, orientation 3: x ", lambda: beginning.out)
    first.type("q\n")
    assert ended(beginning, first) == 0
    assert beginning.out.splitlines()[-1] == "The run goes on. `hexacell attach CELL` comes back to it."
    back = start_at(second, start, "attach", cell.cell)
    back.wait_for("You are in control of this run.", lambda: back.out)
    assert re.search(r"^Now: .*\nDone: \d+ of 61 records", back.out, re.MULTILINE)
    assert "1 of 61: " not in back.out, "what happened before is told in short"
    second.read_until(PLACED)  # at the second point
    second.type("a\n")
    assert ended(back, second) == 130
    assert "To continue:\n  hexacell run " in back.out
    wait_until(lambda: nothing_is_left(load_cell(cell.cell)))
    assert isinstance(history(cell)[-1], events.Interrupted)
    assert not any(isinstance(event, events.Paused) for event in history(cell))


@pytest.mark.slow
def test_a_second_terminal_watches_and_takes_over(cell, start, terminals) -> None:
    first, second, third = terminals
    beginning = start_at(first, start, "run", cell.cell, "--detachable")
    first.read_until(PLACED)
    watching = start_at(second, start, "attach", cell.cell)
    watching.wait_for("is in control of this run; type t to take over.", lambda: watching.out)
    second.read_until(PLACED)
    second.type("\n")
    second.read_until("is in control of this run. Take control first")
    second.type("t\n")
    beginning.wait_for("is in control of this run; type t", lambda: beginning.out)
    second.type("\n")
    watching.wait_for("2 of 61: point 1, orientation 2", lambda: watching.out)
    watching.popen.send_signal(signal.SIGKILL)
    ended(watching, second)
    beginning.wait_for("Nobody is in control of this run; type t", lambda: beginning.out)
    beginning.wait_for("paused\n", lambda: beginning.out)
    first.type("t\nr\n")
    beginning.wait_for("resumed\n", lambda: beginning.out)
    first.type("a\n")
    assert ended(beginning, first) == 130
    nobody = start_at(third, start, "attach", cell.cell)
    assert ended(nobody, third) == 2
    assert "no run of this cell goes on in a process of its own" in third.shown


def test_without_a_terminal_nobody_attaches(cell, typed) -> None:
    for arguments in (["attach", cell.cell], ["run", cell.cell, "--detachable"]):
        refused = typed(*arguments)
        assert refused.code == 2
        assert "terminal" in refused.err
    assert cell.runs() == []
