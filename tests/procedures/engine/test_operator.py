"""Where nobody is, whatever needs a person ends the run and says why."""

from __future__ import annotations

import pytest

from hexacell.errors import AnswerNeeded, ExitCode
from hexacell.kinematics.pose import Pose
from procedures.engine.operator import UnattendedOperator
from procedures.run.events import GateOutcome


async def test_nobody_carries_gauges() -> None:
    with pytest.raises(AnswerNeeded, match=r"point 3 \(X1\.000 .*fixed stations") as refusal:
        await UnattendedOperator().place_gauges(3, Pose(1.0, 2.0, 3.0))
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED


async def test_nobody_approves_and_the_reasons_are_said() -> None:
    gates = [
        GateOutcome(
            name="small change", passed=False, sentence="The largest change is 9 mm.", needs_person=True
        ),
        GateOutcome(name="converged", passed=True, sentence="The solver ended."),
    ]
    with pytest.raises(AnswerNeeded, match=r"approval: The largest change is 9 mm\.$"):
        await UnattendedOperator().approve(gates, "diff")


async def test_nobody_approves_where_the_file_says_to_ask() -> None:
    with pytest.raises(AnswerNeeded, match="the cell file says to ask"):
        await UnattendedOperator().approve([], "diff")
