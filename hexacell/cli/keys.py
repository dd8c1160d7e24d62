"""What a person may type at a plain terminal while a run goes on: one letter and Enter."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TextIO, TypeVar

from hexacell.cli.console import Console
from procedures import events
from procedures.commands import Abort, Command, Inbox, MeasureAgain, Pause, Resume, Undo
from procedures.state import RunState
from procedures.steps import SetKey

Result = TypeVar("Result")

HELP = (
    "Letters, each with Enter: p pause after this record, P at once, r resume,\n"
    "u undo the last record, m measure this point again, a abort."
)


class Keys:
    """Turns typed letters into commands, and is a listener of the engine to know what they refer to."""

    def __init__(self, console: Console, inbox: Inbox, terminal: TextIO) -> None:
        self._console = console
        self._inbox = inbox
        self._terminal = terminal
        self._at: SetKey | None = None

    def __call__(self, event: events.Event, _: RunState) -> None:
        """Follow where the run is."""
        if isinstance(event, events.Arrived):
            self._at = event.at

    async def during(self, work: Coroutine[Any, Any, Result]) -> Result:
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
