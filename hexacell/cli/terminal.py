"""What a person may type at a plain terminal while a run goes on: one letter and Enter.

The person at a plain terminal, asked line by line.
"""

from __future__ import annotations

import asyncio
import sys
import termios
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TextIO, TypeVar

from hexacell.cell.recovery import Action
from hexacell.cli.console import Console
from hexacell.errors import AnswerNeeded
from hexacell.kinematics.pose import Pose
from procedures.run import events
from procedures.run.commands import Abort, Command, CommandQueue, MeasureAgain, Pause, Resume, Undo
from procedures.run.events import GateOutcome
from procedures.run.state import RunState
from procedures.run.steps import SetKey

Result = TypeVar("Result")

HELP = (
    "Letters, each with Enter: p pause after this record, P at once, r resume,\n"
    "u undo the last record, m measure this point again, a abort."
)


class KeyboardCommands:
    """Turns typed letters into commands, and is a listener of the engine to know what they refer to."""

    def __init__(self, console: Console, inbox: CommandQueue, terminal: TextIO) -> None:
        self._console = console
        self._inbox = inbox
        self._terminal = terminal
        self._at: SetKey | None = None

    def __call__(self, event: events.Event, _: RunState) -> None:
        """Follow where the run is."""
        if isinstance(event, events.Arrived):
            self._at = event.at

    async def run_cancellable(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Do some work, heeding what is typed."""
        self.listen()
        try:
            return await work
        finally:
            asyncio.get_running_loop().remove_reader(self._terminal)

    def listen(self) -> None:
        """Take what is typed from now on, until somebody else does."""
        asyncio.get_running_loop().add_reader(self._terminal, self._typed)

    def _typed(self) -> None:
        line = self._terminal.readline()
        if not line:  # the terminal's input has ended, and would be reported for ever
            asyncio.get_running_loop().remove_reader(self._terminal)
            return
        make = self._commands().get(line.strip())
        if make is not None:
            self._inbox.put(make())
        elif line.strip():
            self._console.say(HELP)

    def _commands(self) -> dict[str, Callable[[], Command]]:
        at = self._at
        here: dict[str, Callable[[], Command]] = {} if at is None else {"m": lambda: MeasureAgain(at)}
        return here | {
            "p": Pause,
            "P": lambda: Pause(at_once=True),
            "r": Resume,
            "u": Undo,
            "a": Abort,
        }


def somebody_is_there() -> bool:
    """Whether stdin is a terminal, at which somebody can answer."""
    return sys.stdin is not None and sys.stdin.isatty()


class TerminalOperator:
    """Asks on the terminal that stdin is; ``before`` and ``afterwards`` are called around a question."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self.before: Callable[[], None] = lambda: None
        self.afterwards: Callable[[], None] = lambda: None

    async def place_gauges(self, point: int, pose: Pose) -> None:
        """Ask for the gauges to be put around the ball.

        Raises:
            AnswerNeeded: the terminal's input has ended.
        """
        await self._answer(
            f"\nPoint {point}: the robot stands at {pose}.\n"
            "Put the three gauges around the ball, plungers in the middle of their travel.\n"
            "Press Enter when they stand. "
        )

    async def approve(self, gates: Sequence[GateOutcome], change: str) -> str | None:
        """Show the change and ask whether it may be written.

        Raises:
            AnswerNeeded: the terminal's input has ended.
        """
        conditions = "".join(f"{'ok' if gate.passed else 'NO'}  {gate.sentence}\n" for gate in gates)
        question = "Write this into the controller's config? Type yes: "
        answer = await self._answer(f"\n{change}\n{conditions}{question}")
        return "a person at the terminal" if answer.strip().lower() == "yes" else None

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        """Tell what failed and ask how to go on, until the answer is one of the choices.

        Raises:
            AnswerNeeded: the terminal's input has ended.
        """
        words = ", ".join(choice.value for choice in choices)
        question = f"\n{problem}\nHow to go on ({words})? "
        while True:
            answer = (await self._answer(question)).strip().lower().replace(" ", "-")
            found = [choice for choice in choices if answer and choice.value.startswith(answer)]
            if len(found) == 1:
                return found[0]
            question = f"Type one of {words}: "

    async def _answer(self, question: str) -> str:
        self.before()
        # An Enter too many, pressed before, must not answer what was not asked yet.
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
        self._console.ask(question)
        try:
            line = await _line(sys.stdin)
        except asyncio.CancelledError:
            self._console.ask("\n")
            raise
        finally:
            self.afterwards()
        if not line:
            self._console.ask("\n")
            raise AnswerNeeded("the question was left without an answer", action="Run it at a terminal")
        return line


async def _line(terminal: TextIO) -> str:
    """The next line; waited for without a thread, which Ctrl-C would have to wait for."""
    loop = asyncio.get_running_loop()
    typed = asyncio.Event()
    loop.add_reader(terminal, typed.set)
    try:
        await typed.wait()
    finally:
        loop.remove_reader(terminal)
    return terminal.readline()
