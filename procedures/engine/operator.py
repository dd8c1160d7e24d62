"""Operators, who answer the questions of a run: a person at any face, or none."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from hexacell.errors import AnswerNeeded
from procedures.run.cancellation import cancel_and_wait
from procedures.run.questions import GaugePlacement, PendingChange, Question, StepFailure


class Operator(Protocol):
    """Answers questions."""

    async def ask(self, question: Question) -> str | None:
        """The answer; see :class:`procedures.run.questions.Question`.

        Raises:
            AnswerNeeded: there is no answer.
        """
        ...


class QuestionBroker:
    """An :class:`Operator` that passes questions on, and takes an answer from any face meanwhile.

    The first answer counts: the operator's, or the one given to :meth:`answer`.

    Attributes:
        open: the question that waits for an answer, if one does.
        on_change: called whenever a question is opened or closed.
    """

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._answer: asyncio.Future[str | None] | None = None
        self.open: Question | None = None
        self.on_change: Callable[[], None] = lambda: None

    def answer(self, answer: str | None) -> bool:
        """Answer the open question; False if none is open or this is no answer to it."""
        if self.open is None or self._answer is None or self._answer.done():
            return False
        answer = self.open.resolve(answer)
        if not self.open.accepts(answer):
            return False
        self._answer.set_result(answer)
        return True

    async def ask(self, question: Question) -> str | None:
        """See :meth:`Operator.ask`."""
        asked = asyncio.ensure_future(self._operator.ask(question))
        self._answer = asyncio.get_running_loop().create_future()
        self._set_open(question)
        try:
            await asyncio.wait([asked, self._answer], return_when=asyncio.FIRST_COMPLETED)
            return self._answer.result() if self._answer.done() else asked.result()
        finally:
            self._answer.cancel()
            self._set_open(None)
            await cancel_and_wait(asked)

    def _set_open(self, question: Question | None) -> None:
        self.open = question
        self.on_change()


class UnattendedOperator:
    """No person is present: every question ends the run."""

    async def ask(self, question: Question) -> str | None:
        """Refuse.

        Raises:
            AnswerNeeded: names what is needed, and how to run without it where that is possible.
        """
        raise _unanswered(question)


def _unanswered(question: Question) -> AnswerNeeded:
    match question.subject:
        case GaugePlacement(point=point, pose=pose):
            return AnswerNeeded(
                f"the gauges must be put around the ball at point {point} ({pose}), and nobody is there",
                action='Run it attended, or use fixed stations (placement = "fixed" in [stations])',
            )
        case PendingChange(gates=gates):
            reasons = " ".join(gate.sentence for gate in gates if not gate.passed)
            return AnswerNeeded(
                f"the new geometry waits for approval: {reasons or 'the cell file says to ask'}"
            )
        case StepFailure(problem=problem):
            return AnswerNeeded(f"{problem} Somebody must choose: {', '.join(question.choices)}")
