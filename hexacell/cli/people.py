"""The person at a plain terminal, asked line by line."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

from hexacell.cli.console import Console
from hexacell.pose import Pose
from procedures.events import Gate
from procedures.operators import Nobody


class AtTerminal:
    """Asks on the terminal; where stdin is none, nobody is there."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._nobody = Nobody()

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """Ask for the gauges to be put around the ball.

        Raises:
            AnswerNeeded: there is no terminal to ask on.
        """
        if not sys.stdin.isatty():
            await self._nobody.place_gauges(point, pose)
        self._console.say(f"\nPoint {point}: the robot stands at {pose}.")
        self._console.say("Put the three gauges around the ball, plungers in the middle of their travel.")
        await self._answer("Press Enter when they stand. ")

    async def approve(self, gates: Sequence[Gate], change: str) -> str | None:
        """Show the change and ask whether it may be written.

        Raises:
            AnswerNeeded: there is no terminal to ask on.
        """
        if not sys.stdin.isatty():
            return await self._nobody.approve(gates, change)
        self._console.say("\n" + change)
        for gate in gates:
            self._console.say(f"{'ok ' if gate.passed else 'NO '} {gate.sentence}")
        answer = await self._answer("Write this into the controller's config? Type yes: ")
        return "a person at the terminal" if answer.strip().lower() == "yes" else None

    async def _answer(self, question: str) -> str:
        print(question, end="", file=sys.stderr, flush=True)
        return await asyncio.to_thread(sys.stdin.readline)
