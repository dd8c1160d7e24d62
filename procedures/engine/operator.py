"""Where questions to a person lie open, so that any face sees them and any may answer.

Who answers when the procedure cannot go on alone.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded
from hexacell.kinematics.pose import Pose
from procedures.run.cancellation import cancel_and_wait
from procedures.run.events import GateOutcome

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Question:
    """What a person is asked: plain words, and the answers there are."""

    kind: Literal["place", "approve", "decide"]
    words: str
    choices: tuple[str, ...] = ()


class QuestionBroker:
    """An :class:`Operator` that asks another, or takes the answer that is handed in first.

    ``on_change`` is called whenever a question is put or answered.
    """

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._answer: asyncio.Future[object] | None = None
        self.open: Question | None = None
        self.on_change: Callable[[], None] = lambda: None

    def answer(self, value: object) -> bool:
        """Hand in the answer to the open question; whether there is one that takes it."""
        question, waiting = self.open, self._answer
        if question is None or waiting is None or waiting.done() or not _fits(question, value):
            return False
        waiting.set_result(value)
        return True

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """See :meth:`Operator.place_gauges`; any answer means that they stand."""
        question = Question("place", f"Put the gauges around the ball at point {point} ({pose}).")
        await self._asked(question, self._operator.place_gauges(point, pose))

    async def approve(self, gates: Sequence[GateOutcome], change: str) -> str | None:
        """See :meth:`Operator.approve`; the answer is a name, or nothing."""
        question = Question("approve", "Write this into the controller's config?\n" + change)
        answer: Any = await self._asked(question, self._operator.approve(gates, change))
        return None if answer is None else str(answer)

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        """See :meth:`Operator.decide`; the answer is one of the choices."""
        question = Question("decide", problem, tuple(choice.value for choice in choices))
        answer: Any = await self._asked(question, self._operator.decide(problem, choices))
        return Action(answer)

    async def _asked(self, question: Question, asking: Coroutine[Any, Any, object]) -> object:
        asked = asyncio.ensure_future(asking)
        self._answer = asyncio.get_running_loop().create_future()
        self._put(question)
        try:
            await asyncio.wait([asked, self._answer], return_when=asyncio.FIRST_COMPLETED)
            return self._answer.result() if self._answer.done() else asked.result()
        finally:
            self._answer.cancel()
            self._put(None)
            await cancel_and_wait(asked)

    def _put(self, question: Question | None) -> None:
        self.open = question
        self.on_change()


def _fits(question: Question, value: object) -> bool:
    return not question.choices or value in question.choices


class Operator(Protocol):
    """A person, or what stands in for one."""

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """Return once the gauges stand around the ball, plungers in the middle of their travel."""
        ...

    async def approve(self, gates: Sequence[GateOutcome], change: str) -> str | None:
        """The name of who lets the change into the controller; nothing where it is declined."""
        ...

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        """What follows a failure that ``problem`` tells in plain words; one of the choices."""
        ...


class UnattendedOperator:
    """No person is there: whatever needs one ends the run."""

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """Always refuses.

        Raises:
            AnswerNeeded: gauges do not walk.
        """
        raise AnswerNeeded(
            f"the gauges must be put around the ball at point {point} ({pose}), and nobody is there",
            action='Run it attended, or use fixed stations (placement = "fixed" in [stations])',
        )

    async def approve(self, gates: Sequence[GateOutcome], change: str) -> str | None:
        """Always refuses.

        Raises:
            AnswerNeeded: says why a person is needed.
        """
        del change
        reasons = [gate.sentence for gate in gates if not gate.passed]
        raise AnswerNeeded(
            "the new geometry waits for approval: " + (" ".join(reasons) or "the cell file says to ask")
        )

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        """Always refuses.

        Raises:
            AnswerNeeded: says what is to be decided.
        """
        words = ", ".join(choice.value for choice in choices)
        raise AnswerNeeded(f"{problem} Somebody must choose: {words}")
