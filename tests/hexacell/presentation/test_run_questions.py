"""Questions as they are put on a terminal: what they are about first, what to type last."""

from __future__ import annotations

import pytest

from hexacell.acceptance import AcceptanceGate
from hexacell.campaign.teaching import TaskDisplacement
from hexacell.cell.recovery import Action
from hexacell.decision import Verdict
from hexacell.kinematics.pose import Pose
from hexacell.presentation.run import matching_choice, question_text, repeated_text
from hexacell.presentation.teaching import teaching_sentence
from hexacell.reporting.verification import Verification
from procedures.run.questions import ask_acceptance, ask_approval, ask_placement, ask_recovery

CHOICES = (Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT)
FAILURE = ask_recovery("It broke.", CHOICES)


def test_placing_gauges_names_the_point_and_the_pose() -> None:
    text = question_text(ask_placement(3, Pose(1.0, 2.0, 3.0)))
    assert text.startswith("\nPoint 3: the robot is at X1.000 ")
    assert text.endswith("Press Enter when they are in place. ")


def test_an_approval_shows_the_change_then_every_gate() -> None:
    gates = [
        AcceptanceGate(name="converged", passed=True, sentence="The solver ended."),
        AcceptanceGate(name="small change", passed=False, sentence="It is 9 mm.", needs_person=True),
    ]
    assert question_text(ask_approval(gates, "-1\n+2", cell="bench")) == (
        "\n-1\n+2\nok  The solver ended.\nNO  It is 9 mm.\n"
        "Write this into the controller's config? Type yes: "
    )


def test_approval_and_acceptance_say_what_must_be_taught_anew_before_it_asks() -> None:
    moved = TaskDisplacement(position_mm=30.8, orientation_deg=4.0, poses=6, is_within_limits=False)
    whether_written = ask_approval([], "-1\n+2", moved, cell="bench")
    whether_kept = ask_acceptance("all ill", Verification(verdict=Verdict.FAIL), moved)
    for question, asks in ((whether_written, "Write this"), (whether_kept, "The new geometry is in")):
        *_, first, second, asked = question_text(question).splitlines()
        assert f"{first} {second.strip()}" == teaching_sentence(moved)
        assert asked.startswith(asks)


def test_a_failure_names_the_choices() -> None:
    assert (
        question_text(FAILURE) == "\nIt broke.\nHow to continue (retry, measure-again, redo-set, abort)? "
    )
    assert repeated_text(FAILURE) == "Type one of retry, measure-again, redo-set, abort: "


@pytest.mark.parametrize(
    ("typed", "choice"),
    [
        ("redo\n", "redo-set"),
        ("Measure again\n", "measure-again"),
        ("a", "abort"),
        ("re", None),
        ("\n", None),
        ("leave", None),
    ],
)
def test_an_unambiguous_beginning_selects_a_choice(typed: str, choice: str | None) -> None:
    assert matching_choice(typed, FAILURE) == choice
