"""Questions as they are put on a terminal: what they are about first, what to type last."""

from __future__ import annotations

from hexacell.cell.recovery import Action
from hexacell.kinematics.pose import Pose
from hexacell.presentation.questions import question_text
from procedures.run.events import GateOutcome
from procedures.run.questions import ask_approval, ask_placement, ask_recovery


def test_placing_gauges_names_the_point_and_the_pose() -> None:
    text = question_text(ask_placement(3, Pose(1.0, 2.0, 3.0)))
    assert text.startswith("\nPoint 3: the robot stands at X1.000 ")
    assert text.endswith("Press Enter when they stand. ")


def test_an_approval_shows_the_change_then_every_gate() -> None:
    gates = [
        GateOutcome(name="converged", passed=True, sentence="The solver ended."),
        GateOutcome(name="small change", passed=False, sentence="It is 9 mm.", needs_person=True),
    ]
    assert question_text(ask_approval(gates, "-1\n+2")) == (
        "\n-1\n+2\nok  The solver ended.\nNO  It is 9 mm.\n"
        "Write this into the controller's config? Type yes: "
    )


def test_a_failure_names_the_choices() -> None:
    text = question_text(ask_recovery("It broke.", (Action.RETRY, Action.REDO_SET)))
    assert text == "\nIt broke.\nHow to go on (retry, redo-set)? "
