"""Where nobody is, whatever needs a person ends the run and says why."""

from __future__ import annotations

import pytest

from hexacell.acceptance.gates import AcceptanceGate
from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded, ExitCode
from hexacell.kinematics.pose import Pose
from procedures.engine.operator import UnattendedOperator
from procedures.run.questions import ask_approval, ask_placement, ask_recovery


async def test_nobody_carries_gauges() -> None:
    with pytest.raises(AnswerNeeded, match=r"point 3 \(X1\.000 .*fixed stations") as refusal:
        await UnattendedOperator().ask(ask_placement(3, Pose(1.0, 2.0, 3.0)))
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED


async def test_nobody_approves_and_the_reasons_are_said() -> None:
    gates = [
        AcceptanceGate(
            name="small change", passed=False, sentence="The largest change is 9 mm.", needs_person=True
        ),
        AcceptanceGate(name="converged", passed=True, sentence="The solver ended."),
    ]
    with pytest.raises(AnswerNeeded, match=r"approval: The largest change is 9 mm\.$"):
        await UnattendedOperator().ask(ask_approval(gates, "diff"))


async def test_nobody_approves_where_the_file_says_to_ask() -> None:
    with pytest.raises(AnswerNeeded, match="the cell file says to ask"):
        await UnattendedOperator().ask(ask_approval([], "diff"))


async def test_nobody_chooses_what_follows_a_failure() -> None:
    question = ask_recovery("It broke.", (Action.RETRY, Action.ABORT))
    with pytest.raises(AnswerNeeded, match=r"^It broke\. Somebody must choose: retry, abort"):
        await UnattendedOperator().ask(question)
