"""Questions as they are put on a terminal: what they are about first, what to type last."""

from drivers.interfaces import StartupAction
from hexacell.cell.recovery import Action
from hexacell.cli.terminal import question_text
from hexacell.kinematics.pose import Pose
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.text.screens.questions import question_view
from hexacell.text.verdict import teaching_sentence
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import Verification
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import (
    NO,
    YES,
    PendingChange,
    Question,
    ask_acceptance,
    ask_approval,
    ask_placement,
    ask_recovery,
    ask_startup,
)

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
    whether_kept = ask_acceptance("all ill", Verification(verdict=Verdict.FAIL), moved)
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
    what = "The robot stands still: this went wrong"
    assert (
        question_text(question_view(FAILURE, None))
        == f"\n{what}\nIt broke.\n{question_view(FAILURE, None).request}"
    )
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
