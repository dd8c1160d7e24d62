"""Poses are taken out of the plan at a plain terminal, before the run begins."""

from __future__ import annotations

import pytest

from hexacell.text.plan_draft import REQUEST
from procedures.journal.journal import read_journal
from procedures.run import events
from tests.cli.terminal import ended, start_at
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("lines_only")

ASKED = REQUEST.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["--detachable"]], ids=["", "detachable"])
def test_what_is_typed_is_taken_out_of_the_run(quick_cell, start, terminal, more) -> None:
    process = start_at(terminal, start, "run", quick_cell.cell, "--plan", *more)
    terminal.read_until(ASKED)
    assert "         1.2  a " in process.out
    terminal.type("2.1 7\n")
    terminal.read_until(ASKED)
    assert "2.1 is the reference of point 2" in process.out
    terminal.type("2.4\n")
    terminal.read_until(ASKED)
    assert "Left out: 1 pose. That costs" in process.out
    terminal.type("l\n")
    terminal.read_until(ASKED)
    assert "OUT       r1  a " in process.out
    terminal.type("\n")
    process.wait_for("left out of the plan: 1 pose", lambda: process.out)
    terminal.type("a\n")
    assert ended(process, terminal) == 130
    [run] = quick_cell.runs()
    [started] = [one for one in read_journal(run / "journal.jsonl") if isinstance(one, events.RunStarted)]
    [removed] = started.removed.poses
    assert removed.point == 2


def test_q_begins_no_run(quick_cell, start, terminal) -> None:
    process = start_at(terminal, start, "run", quick_cell.cell, "--plan")
    terminal.read_until(ASKED)
    terminal.type("q\n")
    wait_until(lambda: process.popen.poll() is not None)
    assert ended(process, terminal) == 4
    assert not quick_cell.runs()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--resume"], "no run of this cell was interrupted"),
        (["--unattended"], "--plan needs somebody at a terminal"),
    ],
)
def test_where_it_cannot_be_asked_it_is_refused(typed_here, quick_cell, more, said) -> None:
    outcome = typed_here("run", quick_cell.cell, "--plan", *more)
    assert outcome.code == 2
    assert said in outcome.err


def test_a_resumed_run_keeps_its_plan(typed_here, quick_cell, demo) -> None:
    outcome = typed_here("run", quick_cell.cell, "--plan", "--resume", demo.run)
    assert outcome.code == 2
    assert "the plan of a run that is resumed stays as it was" in outcome.err
