"""Accept: a person decides whether a written geometry that did not pass stays."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from hexacell.errors import AnswerNeeded
from procedures.resources.run_resources import RunResources
from procedures.run.questions import Question, WrittenResult
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepWithoutMotion


class ResultAccepted(BaseEvent):
    """A person decided on a result that did not pass; ``by`` is who keeps it, null if nobody does.

    ``asked`` is whether there was somebody to ask.
    """

    kind: Literal["accepted"] = "accepted"
    by: str | None
    asked: bool = True

    kept_as: ClassVar[str] = "accepted"


class Accept(StepWithoutMotion):
    """Ask whether the written geometry stays; nothing is changed."""

    kind: Literal["accept"] = "accept"

    outcomes: ClassVar = (ResultAccepted,)
    takes: ClassVar[TimeKind] = TimeKind.ASKING
    doing: ClassVar[str] = "waiting for a decision on the result"
    is_reproducible: ClassVar[bool] = False

    async def perform(self, run: RunResources, state: RunState) -> ResultAccepted:
        judged = state.judged
        assert judged is not None  # noqa: S101 - decided only after the verdict
        moved = state.proposed.displacement if state.proposed else None
        try:
            name = await run.operator.ask(Question(WrittenResult(judged.line, moved)))
        except AnswerNeeded:
            return ResultAccepted(by=None, asked=False)
        return ResultAccepted(by=name)
