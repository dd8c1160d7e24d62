"""What a person may type at a plain terminal while a run goes on: one letter and Enter.

The person at a plain terminal, asked line by line.
"""

from __future__ import annotations

import asyncio
import sys
import termios
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TextIO, TypeVar

from hexacell.cli.console import Console
from hexacell.errors import AnswerNeeded
from hexacell.presentation.questions import question_text
from procedures.run import events
from procedures.run.commands import Abort, Command, CommandQueue, MeasureAgain, Pause, Resume, Undo
from procedures.run.questions import Question, QuestionKind
from procedures.run.state import RunState
from procedures.run.steps import SetKey

Result = TypeVar("Result")

HELP = (
    "Letters, each with Enter: p pause after this record, P at once, r resume,\n"
    "u undo the last record, m measure this point again, a abort."
)

APPROVER = "a person at the terminal"
"""Who approves a change, as the journal has it."""


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

    async def ask(self, question: Question) -> str | None:
        """Show the question and read lines until one is an answer.

        Raises:
            AnswerNeeded: the terminal's input has ended.
        """
        text = question_text(question)
        while True:
            typed = (await self._answer(text)).strip().lower()
            if question.kind is QuestionKind.APPROVE_CHANGE:
                return APPROVER if typed == "yes" else None
            if question.default is not None:
                return question.default
            if (chosen := _choice(typed, question.choices)) is not None:
                return chosen
            text = f"Type one of {', '.join(question.choices)}: "

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


def _choice(typed: str, choices: Sequence[str]) -> str | None:
    """The one choice that begins with what was typed."""
    typed = typed.replace(" ", "-")
    found = [choice for choice in choices if typed and choice.startswith(typed)]
    return found[0] if len(found) == 1 else None


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
