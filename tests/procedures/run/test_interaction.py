"""Questions: what is accepted as an answer; work is completed despite cancellation."""

import asyncio

import pytest

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode
from hexacell.kinematics.pose import Pose
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.engine.commands import QuestionBroker, UnattendedOperator
from procedures.run.cancellation import shielded
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import (
    GaugePlacement,
    PendingChange,
    Question,
    StepFailure,
    ask_approval,
    ask_placement,
    ask_recovery,
)
from tests.procedures.fakes import SilentOperator


def placement_at(point: int) -> Question:
    return ask_placement(SetKey(phase=Phase.IDENTIFY, point=point), Pose(1.0, 2.0, 3.0))


LARGE = AcceptanceGate(
    name="small change", passed=False, sentence="The largest change is 9 mm.", needs_person=True
)
GOOD = AcceptanceGate(name="converged", passed=True, sentence="The solver ended.")


@pytest.mark.parametrize(
    ("question", "words"),
    [
        (placement_at(3), r"point 3 \(X1\.000 .*fixed stations"),
        (ask_approval(PendingChange((LARGE, GOOD), "diff"), cell="bench"), r"largest change is 9 mm\.$"),
        (ask_approval(PendingChange((), "diff"), cell="bench"), "the cell file says to ask"),
        (ask_recovery("It broke.", (Action.RETRY, Action.ABORT)), r"^It broke\. A .*: retry, abort"),
    ],
)
async def test_an_unattended_run_says_what_a_person_must_answer(question: Question, words: str) -> None:
    with pytest.raises(AnswerNeeded, match=words) as refusal:
        await UnattendedOperator().ask(question)
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED


async def test_only_a_choice_of_the_question_is_an_answer() -> None:
    broker = QuestionBroker(SilentOperator())
    assert not broker.answer("retry"), "no question is open"
    asking = asyncio.create_task(broker.ask(ask_recovery("It broke.", (Action.RETRY, Action.ABORT))))
    await asyncio.sleep(0)
    assert broker.open
    assert broker.open.subject == StepFailure("It broke.")
    assert broker.open.choices == ("retry", "abort")
    assert not broker.answer("redo-set")
    assert not broker.answer(None), "a choice must be made"
    assert broker.answer("retry")
    assert not broker.answer("abort"), "it is answered"
    assert await asking == "retry"
    assert broker.open is None


async def test_an_empty_answer_is_the_default() -> None:
    broker = QuestionBroker(SilentOperator())
    asking = asyncio.create_task(broker.ask(placement_at(2)))
    await asyncio.sleep(0)
    assert broker.open
    assert broker.open.subject == GaugePlacement(2, Pose(1.0, 2.0, 3.0), "point 2")
    assert broker.answer(None)
    assert await asking == "placed"


async def work(turns: int, done: list[int]) -> int:
    for _ in range(turns):
        await asyncio.sleep(0)
    done.append(turns)
    return turns


@pytest.mark.parametrize("times", [1, 2, 4])
async def test_shielded_work_is_completed_before_the_cancellation_is_raised(times: int) -> None:
    done: list[int] = []
    task = asyncio.create_task(shielded(work(8, done)))
    for _ in range(times):
        await asyncio.sleep(0)
        task.cancel()
    assert done == []
    with pytest.raises(asyncio.CancelledError):
        await task
    assert done == [8]


async def test_an_error_of_cancelled_shielded_work_is_raised() -> None:
    cancelled = asyncio.Event()

    async def fail() -> None:
        await cancelled.wait()
        raise DeviceError("broken")

    task = asyncio.create_task(shielded(fail()))
    await asyncio.sleep(0)
    task.cancel()
    cancelled.set()
    with pytest.raises(DeviceError):
        await task
