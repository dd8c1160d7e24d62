"""A person at a plain terminal, who answers questions line by line and types commands as letters or Ctrl-C.

Signals become commands to the engine, never an exception in the middle of a step.
"""

import asyncio
import signal
import sys
import termios
from collections.abc import Callable, Coroutine, Iterable, Mapping
from dataclasses import dataclass
from io import TextIOWrapper
from types import FrameType
from typing import Any, TextIO, TypeVar

from hexacell.cli.console import Console
from hexacell.cli.process import STOP_SIGNALS, forward_to_sigint, handled
from hexacell.errors import AnswerNeeded, Interruption
from hexacell.text.layout import wrapped
from hexacell.text.line_face import LETTERS
from hexacell.text.screens.questions import question_view
from hexacell.text.screens.views import QuestionView
from procedures.engine.commands import Abort, Command, CommandQueue, MeasureAgain, Pause, Resume, Stop, Undo
from procedures.run.keys import SetKey
from procedures.run.questions import Question
from procedures.run.state import RunState
from procedures.steps import events

Result = TypeVar("Result")

KEYS = frozenset({signal.SIGINT, signal.SIGQUIT, signal.SIGTSTP})
"""Sent by a key. A run that Ctrl-Z suspends would watch its robot no longer: the key stops it instead."""

ENDING_SIGNALS: tuple[int, ...] = (signal.SIGINT, *STOP_SIGNALS, signal.SIGTSTP)

_FREE = (signal.SIG_DFL, signal.default_int_handler, forward_to_sigint)

APPROVER = "a person at the terminal"
"""Who approves a change, as the journal has it."""


def is_interactive() -> bool:
    """Whether stdin is a terminal, at which a person can answer."""
    return sys.stdin is not None and sys.stdin.isatty()


class SignalCommands:
    """Turns signals into commands: the first is a clean stop, a second Ctrl-C stops motion at once."""

    def __init__(self, console: Console) -> None:
        self.queue = CommandQueue()
        self._console = console
        self._stop_requested = False

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """``asyncio.run`` with signals turned into commands.

        Before an engine reads the queue, a signal cancels the work, which then cleans up, and an
        ``Interruption`` is raised. After the engine has ended, a signal has no effect.
        """
        # An ignored one stays so, as Ctrl-C in a script's background job, and one that somebody else uses.
        heeded = [number for number in ENDING_SIGNALS if signal.getsignal(number) in _FREE]
        early: list[int] = []
        try:
            # An exception while the loop is being made would leave a half-made loop behind.
            with handled(heeded, lambda number, _: early.append(number)):
                return asyncio.run(self._with_handlers(work, heeded, early))
        except asyncio.CancelledError:
            raise Interruption("interrupted") from None

    async def _with_handlers(
        self, work: Coroutine[Any, Any, Result], heeded: Iterable[int], early: list[int]
    ) -> Result:
        loop, task = asyncio.get_running_loop(), asyncio.ensure_future(work)

        def handle(number: int, _: FrameType | None) -> None:
            loop.call_soon_threadsafe(self._handle, number, task)

        with handled(heeded, handle):
            for number in early:
                handle(number, None)
            return await task

    def _handle(self, number: int, task: asyncio.Task[Any]) -> None:
        if self.queue.is_over:
            return
        if not self.queue.is_attended:
            task.cancel()
        elif self._stop_requested and number == signal.SIGINT:
            self.queue.put(Abort("interrupted"))
        else:
            self._stop_requested = True
            self.queue.put(Stop("interrupted"))
            if number in KEYS:
                self._console.print("Stopping after this step; Ctrl-C again stops motion at once.")


@dataclass(eq=False)
class KeyboardCommands:
    """Turns letters that are typed into commands; listens to the engine to know which set they refer to.

    ``put`` takes the commands. ``answers`` are further letters, each with what prints an answer.
    """

    console: Console
    put: Callable[[Command], None]
    terminal: TextIO
    answers: Mapping[str, Callable[[], None]]
    _at: SetKey | None = None

    def __call__(self, event: events.Event, _: RunState) -> None:
        """Keep the set that is being measured."""
        if isinstance(event, events.Arrived):
            self._at = event.at

    async def listen_during(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Do some work and turn what is typed meanwhile into commands."""
        self.listen()
        try:
            return await work
        finally:
            asyncio.get_running_loop().remove_reader(self.terminal)

    def listen(self) -> None:
        """Read what is typed from now on, until another reader of the terminal is installed."""
        asyncio.get_running_loop().add_reader(self.terminal, self._read)

    def _read(self) -> None:
        line = self.terminal.readline()
        if not line:  # end of input, which would be reported again and again
            asyncio.get_running_loop().remove_reader(self.terminal)
            return
        self.take(line)

    def take(self, line: str) -> None:
        """Put the command that a line means into the queue; explain the letters where it means none."""
        word, _, number = line.strip().partition(" ")
        answer, make = self.answers.get(word), self._commands(number).get(word)
        if answer is not None:
            answer()
        elif make is not None:
            self.put(make())
        elif word:
            self.console.print(LETTERS)

    def _commands(self, number: str) -> dict[str, Callable[[], Command]]:
        """The commands by their letters; a number is that of a record of this point."""
        at, again = self._at, int(number) if number.isdecimal() else None
        if number:
            return {} if at is None or again is None else {"m": lambda: MeasureAgain(at, again)}
        here: dict[str, Callable[[], Command]] = {} if at is None else {"m": lambda: MeasureAgain(at)}
        return here | {"p": Pause, "P": lambda: Pause(at_once=True), "r": Resume, "u": Undo, "a": Abort}


class TerminalOperator:
    """Asks the person at stdin.

    Attributes:
        type_command: called with a line that is no answer to the question.
        before_question: called before a question is shown.
        after_question: called once it is answered or given up.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        if isinstance(sys.stdin, TextIOWrapper):
            sys.stdin.reconfigure(errors="replace")  # any key may be pressed, and is no answer then
        self.type_command: Callable[[str], None] = lambda _: None
        self.before_question: Callable[[], None] = lambda: None
        self.after_question: Callable[[], None] = lambda: None

    async def ask(self, question: Question) -> str | None:
        """Show the question and read lines until one is an answer.

        Raises:
            AnswerNeeded: the terminal's input has ended.
        """
        view = question_view(question, None, APPROVER)
        text = question_text(view)
        while True:
            typed = await self._answer(text)
            if (choice := view.typed_choice(typed)) is not None:
                return choice.value
            self.type_command(typed)
            text = view.request

    async def _answer(self, question: str) -> str:
        self.before_question()
        # An Enter pressed too often, before this question, must not answer it.
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
        self._console.prompt(question)
        try:
            # No thread waits for the line: Ctrl-C would have to wait for that thread.
            loop, typed = asyncio.get_running_loop(), asyncio.Event()
            loop.add_reader(sys.stdin, typed.set)
            try:
                await typed.wait()
            finally:
                loop.remove_reader(sys.stdin)
            line = sys.stdin.readline()
        except asyncio.CancelledError:
            self._console.prompt("\n")
            raise
        finally:
            self.after_question()
        if not line:
            self._console.prompt("\n")
            raise AnswerNeeded("the question was left without an answer", action="Run it at a terminal")
        return line


def question_text(view: QuestionView) -> str:
    """The question for a terminal that reads one line as the answer, as the screen asks it.

    The change of a config comes first: what decides about it is then in sight beside the question.
    """
    about = [text if "\n" in text else wrapped(text, indent=4) for text in view.paragraphs]
    if view.title.endswith("?"):
        return "\n".join(["", *filter(None, [view.change]), *about, f"{view.title}\n{view.request}"])
    return "\n".join(["", view.title, *about, view.request])
