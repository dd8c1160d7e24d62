"""Approval of a new geometry: by limits, by a person, or not at all."""

import re
from pathlib import Path

import pytest

from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.cli.cell_folder import ASK, BY_HAND
from tests.cli.terminal import ended, start_at

PLACED = "Press Enter when they are in place, or type a to abort: "
FAST = (
    ("clock_factor = 150.0", "clock_factor = 600.0"),
    ("give_up_s = 60.0", "give_up_s = 6000.0"),
    ("encoder_mm = 0.01\ngauge_mm = 0.01", "encoder_mm = 0.014\ngauge_mm = 0.014"),
)


@pytest.fixture
def fast_cell(cell_folder):
    cell_folder.edit(*FAST)
    cell_folder.wait_long_for_devices()
    return cell_folder


def test_a_run_without_a_name_is_not_begun_as_one_to_resume(typed_here, fast_cell):
    outcome = typed_here("run", fast_cell.cell, "--resume", "", "--json")
    assert outcome.code == 2
    assert outcome.document["error"].startswith("there is no run ''")
    assert not fast_cell.runs()


@pytest.mark.usefixtures("few_candidates")
class TestUnattendedRun:
    def test_a_run_that_needs_approval_ends_and_keeps_its_proposal(self, typed_here, fast_cell, demo):
        fast_cell.edit(ASK)
        run = fast_cell.rewound(demo.run, before="propose")
        config = fast_cell.controller.read_bytes()
        outcome = typed_here("run", fast_cell.cell, "--resume", run, "--json")
        assert outcome.code == outcome.document["exit_code"] == 4
        assert "the new geometry waits for approval: the cell file says to ask" in outcome.err
        assert f"--resume {run}" in outcome.err
        assert (run / "proposal.json").is_file()
        assert fast_cell.controller.read_bytes() == config
        assert not (run / "config-after").exists()

    def test_a_check_changes_nothing(self, typed_here, fast_cell):
        config = fast_cell.controller.read_bytes()
        outcome = typed_here("run", fast_cell.cell, "--unattended", "--json")
        assert outcome.code == outcome.document["exit_code"] == 1
        document = outcome.document
        assert re.match(r"check: \d+ records at 2 points; position error at the task", document["line"])
        assert document["line"].endswith(" mm (limit 0.3, safety margin 1.5 U): fail")
        assert document["verdict"] == document["check"]["verdict"] == "fail"
        assert document["check"]["earlier_run"] is None
        assert "the check starts from the drawing" in " ".join(outcome.err.split())
        assert Path(document["measurements"]).is_file()
        assert fast_cell.controller.read_bytes() == config
        [run] = fast_cell.runs()
        sampled = [e for e in read_journal(run / "journal.jsonl") if isinstance(e, events.RecordTaken)]
        assert {event.at.phase.value for event in sampled} == {"P"}

    def test_closed_standard_streams_are_unattended(self, start, fast_cell):
        fast_cell.edit(BY_HAND)
        process = start("run", fast_cell.cell, through='exec "$@" <&- >&- 2>&-')
        assert process.popen.wait() == 4
        assert fast_cell.runs() == []


class TestAPersonAtTheTerminal:
    @pytest.fixture
    def waiting(self, fast_cell, demo, start, terminal):
        """A run that shows its proposal and asks; its terminal; its config before."""
        fast_cell.edit(ASK)
        run = fast_cell.rewound(demo.run, before="propose")
        process = start_at(terminal, start, "run", fast_cell.cell, "--resume", run)
        question = terminal.read_until("Type yes or no: ")
        return process, question, fast_cell

    @pytest.mark.slow
    def test_sees_the_change_and_approves_it(self, waiting, terminal, demo):
        process, question, cell = waiting
        lines = question.replace("\r\n", "\n").splitlines()
        assert {"--- config-before", "+++ config-after"} <= set(lines)
        assert len([line for line in lines if line.startswith("ok  ")]) == 4
        assert not any(line.startswith("NO  ") for line in lines)
        terminal.type("yes\n")
        assert ended(process, terminal) == 0
        assert cell.controller.read_bytes() != (demo.run / "config-before").read_bytes()
        assert "approved by a person at the terminal" in process.out
        assert process.out.splitlines()[-1].endswith(": pass")

    def test_only_no_declines_and_all_else_asks_again(self, waiting, terminal, demo):
        process, _, cell = waiting
        terminal.type("perhaps\n")
        terminal.read_until("Type yes or no: ")
        terminal.type("n\n")
        assert ended(process, terminal) == 1
        assert "declined; nothing was applied" in terminal.shown
        assert cell.controller.read_bytes() == (demo.run / "config-before").read_bytes()

    @pytest.mark.slow
    def test_the_end_of_input_leaves_the_question_unanswered(self, waiting, terminal, demo):
        process, _, cell = waiting
        terminal.type("\x04")
        assert ended(process, terminal) == 4
        assert "left without an answer" in terminal.shown
        assert cell.controller.read_bytes() == (demo.run / "config-before").read_bytes()

    @pytest.mark.slow
    def test_places_gauges_and_is_asked_how_to_go_on_after_a_fault(self, quick_cell, start, terminal):
        fixed = ("[guards]", '[guards]\nlimits = "fixed"')
        quick_cell.edit(BY_HAND, ("[acceptance]", "[acceptance]\ndrift_mm = 0.00001"), fixed)
        process = start_at(terminal, start, "run", quick_cell.cell, "--mode", "check")
        first = terminal.read_until(PLACED)
        assert "The robot holds the ball at x 0.0, y 0.0, z 550.0" in first
        terminal.type("\n\n")  # an Enter too many must not answer the next question
        terminal.read_until("Type one of retry, measure-again, redo-set, abort: ")
        terminal.type("re\n")
        terminal.read_until("Type one of retry, measure-again, redo-set, abort: ")
        terminal.type("redo\n")
        terminal.read_until(PLACED)
        [run] = quick_cell.runs()
        placed = [e for e in read_journal(run / "journal.jsonl") if isinstance(e, events.GaugesPlaced)]
        assert len(placed) == 1
        terminal.type("yes\n")  # no answer, and no letter known
        terminal.read_until(PLACED)
        terminal.type("\n")
        terminal.read_until("Type one of retry, measure-again, redo-set, abort: ")
        terminal.type("abort\n")
        assert ended(process, terminal) in {1, 3}
        assert process.out.count("Letters, each with Enter") == 3, "at first, and where nothing is answered"
        assert "measured again" in process.out
        assert "/45" in terminal.shown  # the bar
