"""What a plain terminal shows of a run and asks: its story, how to resume it, an explicit yes."""

import shlex
from datetime import UTC, datetime, timedelta

import pytest

from drivers.interfaces import StartupAction
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.recovery import Action
from hexacell.cli.arguments import make_parser
from hexacell.cli.commands.run import closing_lines, resume_command, run_document
from hexacell.cli.terminal import question_text
from hexacell.kinematics.pose import Pose
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.line_face import run_story, story_text
from hexacell.text.screens.questions import question_view
from hexacell.text.verdict import teaching_line, teaching_sentence
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import (
    NO,
    YES,
    PendingChange,
    Question,
    WrittenResult,
    ask_approval,
    ask_placement,
    ask_recovery,
    ask_startup,
)
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


PLACEMENT = ask_placement(SetKey(phase=Phase.IDENTIFY, point=3), Pose(1.0, 2.0, 3.0))
CHOICES = (Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT)
FAILURE = ask_recovery("It broke.", CHOICES)
APPROVAL = ask_approval(PendingChange((), "-1"), cell="bench")
GRAVE = ask_approval(
    PendingChange((AcceptanceGate(name="a", passed=False, sentence="b.", needs_cell_name=True),), "-1"),
    cell="bench",
)


def test_approval_and_acceptance_say_what_must_be_taught_anew_before_it_asks() -> None:
    moved = TaskDisplacement(position_mm=30.8, orientation_deg=4.0, poses=6, is_within_limits=False)
    whether_written = ask_approval(PendingChange((), "-1\n+2", moved), cell="bench")
    whether_kept = Question(WrittenResult("all ill", moved))
    for question, asks in ((whether_written, "Write the new"), (whether_kept, "The result did not pass.")):
        *about, asked, request = question_text(question_view(question, None)).splitlines()
        assert teaching_sentence(moved) in " ".join(line.strip() for line in about)
        assert asked.startswith(asks)
        assert request == "Type yes or no: "


def test_what_a_question_offers_is_an_answer_and_nothing_else() -> None:
    offered: list[tuple[Question, dict[str, str | None], tuple[str, ...]]] = [
        (PLACEMENT, {"\n": "placed"}, ("a\n", "m\n", "yes\n", "no\n", "placed\n")),
        (
            FAILURE,
            {"redo\n": "redo-set", "Measure again\n": "measure-again", "a": "abort"},
            ("re", "\n", "leave"),
        ),
        (
            APPROVAL,
            {"yes\n": "somebody", "Y\n": "somebody", "no\n": None, "N": None},
            ("\n", "a\n", "yess\n", "bench\n", "ok\n"),
        ),
        (GRAVE, {"bench\n": "somebody", "no\n": None}, ("\n", "yes\n", "y\n", "benc\n")),
    ]
    assert question_view(FAILURE, None).request == "Type one of retry, measure-again, redo-set, abort: "
    for question, answers, others in offered:
        for typed, answer in answers.items():
            choice = question_view(question, None, "somebody").typed_choice(typed)
            assert choice is not None
            assert choice.value == answer
        for typed in others:
            assert question_view(question, None).typed_choice(typed) is None


def test_the_controller_is_made_ready_on_an_explicit_yes_only() -> None:
    question = ask_startup(StartupAction.HOME, "controller: is not homed", is_theirs=False)
    *_, asked, answers = question_text(question_view(question, None)).splitlines()
    assert (asked.endswith("Home it, which moves the machine?"), answers) == (True, "Type yes or no: ")
    for typed, answer in (("y", YES), ("Yes", YES), ("n", NO), ("no", NO)):
        choice = question_view(question, None).typed_choice(typed)
        assert choice is not None
        assert choice.value == answer
    for typed in ("", "a", "m", "home", "yes please"):
        assert question_view(question, None).typed_choice(typed) is None
