"""What a plain terminal shows of a run: its story, how to resume it, what must be taught anew."""

import shlex
from datetime import UTC, datetime, timedelta

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cli.arguments import make_parser
from hexacell.cli.commands.run import closing_lines, resume_command, run_document
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.line_face import run_story, story_text
from hexacell.text.verdict import teaching_line, teaching_sentence
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
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


@pytest.fixture
def request_of(tmp_path):
    def make(mode: Mode) -> RunRequest:
        cell = load_cell(bundled_config("simulated-hexaglide"))
        return RunRequest(cell, RunFolder(tmp_path / "a run"), mode, UnattendedOperator())

    return make


@pytest.mark.parametrize("mode", Mode)
def test_the_resume_command_parses_to_the_same_request(request_of, mode):
    request = request_of(mode)
    program, *arguments = shlex.split(resume_command(request))
    options = make_parser().parse_args(arguments)
    assert program == "hexacell"
    assert (options.cell, options.resume) == (request.cell.path, str(request.folder.path))
    assert options.target == ("run.length" if mode is Mode.LENGTH else "run.main")
    named = mode.value if mode in {Mode.CHECK, Mode.QUICK} else None
    assert getattr(options, "mode", None) == named


def test_one_line_before_the_result_says_what_must_be_taught_anew(request_of):
    moved = TaskDisplacement(position_mm=8.25, orientation_deg=3.0, poses=6, is_within_limits=False)
    ended = events.Ended(exit_code=0, line="all well", displacement=moved)
    request = request_of(Mode.OPTIMISE)
    where, teaching, line = closing_lines(request, ended)
    assert where.endswith(str(request.folder.path))
    assert (teaching, line) == (teaching_line(moved), "all well")
    document = run_document(request, ended, RunState())
    assert document["displacement"] == moved
    assert document["teaching"] == teaching_sentence(moved)
    untouched = run_document(request, events.Ended(exit_code=0, line="all well"), RunState())
    assert untouched["displacement"] is untouched["teaching"] is untouched["measured_noise"] is None
