"""Who answers when the procedure cannot go on alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded
from hexacell.pose import Pose
from procedures.events import Gate


class Operator(Protocol):
    """A person, or what stands in for one."""

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """Return once the gauges stand around the ball, plungers in the middle of their travel."""
        ...

    async def approve(self, gates: Sequence[Gate], change: str) -> str | None:
        """The name of who lets the change into the controller; nothing where it is declined."""
        ...

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        """What follows a failure that ``problem`` tells in plain words; one of the choices."""
        ...


class Nobody:
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

    async def approve(self, gates: Sequence[Gate], change: str) -> str | None:
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
