"""Doing one thing while heeding commands: which of them break it off, and which wait for its end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any, TypeVar

from procedures.engine.operator import QuestionBroker
from procedures.run.cancellation import cancel_and_wait
from procedures.run.commands import (
    Abort,
    Answer,
    Command,
    CommandQueue,
    MeasureAgain,
    Pause,
    Resume,
    Stop,
    Undo,
)
from procedures.run.status import EngineFlags, Status

Result = TypeVar("Result")


class StepCancelled(Exception):
    """A command ended what was being done; the situation says which."""


class CommandLoop:
    """The engine's ear: takes commands out of the inbox and keeps the situation that they make.

    ``supersede`` is given the commands that change what was measured and says why one cannot be
    obeyed; ``decline`` hears of every command that was not.
    """

    def __init__(
        self,
        inbox: CommandQueue,
        desk: QuestionBroker,
        *,
        supersede: Callable[[Undo | MeasureAgain], str | None],
        decline: Callable[[Command, str], None],
    ) -> None:
        self.situation = EngineFlags()
        self.watchers: list[Callable[[Status], None]] = []
        self._inbox = inbox
        self._desk = desk
        self._supersede = supersede
        self._decline = decline
        desk.on_change = lambda: self.set_flags(asking=desk.open is not None)

    def set_flags(self, **facts: Any) -> None:  # noqa: ANN401 - the fields of Situation
        """Take facts into the situation; watchers hear of a new status."""
        before = self.situation.status
        self.situation = replace(self.situation, **facts)
        if (now := self.situation.status) is not before:
            for watcher in self.watchers:
                watcher(now)

    async def run_cancellable(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Do some work to its end.

        Raises:
            BrokenOff: a command did not let it come to its end; it has ended nevertheless.
        """
        task, listening = asyncio.ensure_future(work), asyncio.ensure_future(self._until_broken_off())
        try:
            await asyncio.wait([task, listening], return_when=asyncio.FIRST_COMPLETED)
        finally:
            try:
                await cancel_and_wait(listening)
            finally:
                await cancel_and_wait(task)
        was_told_to = not listening.cancelled()
        if was_told_to:
            listening.result()
        if was_told_to and task.cancelled():
            raise StepCancelled
        return task.result()

    async def take_one(self) -> None:
        """Wait for a command and take it."""
        self._take(await self._inbox.next())

    def catch_up(self) -> None:
        """Take the commands that wait."""
        for command in self._inbox.take():
            self._take(command)

    async def _until_broken_off(self) -> None:
        while not self._take(await self._inbox.next()):
            pass

    def _take(self, command: Command) -> bool:
        """Take one command; whether it breaks off what is being done."""
        now = self.situation
        match command:
            case Stop():
                self.set_flags(stopping=now.stopping or command.reason)
                return now.asking
            case Abort():
                self.set_flags(stopping=command.reason)
                return True
            case Pause() if now.fault is None:
                self.set_flags(pausing=True, at_once=now.at_once or command.at_once)
                return command.at_once or now.asking
            case Resume() if now.resting or now.pausing:
                self.set_flags(pausing=False, at_once=False, resting=False)
            case Answer() if self._desk.answer(command.value):
                pass
            case Undo() | MeasureAgain():
                if reason := self._supersede(command):
                    self._decline(command, reason)
                return now.asking and now.fault is None and not reason
            case _:
                self._decline(command, _useless(command, now))
        return False


def _useless(command: Command, now: EngineFlags) -> str:
    if isinstance(command, Answer):
        return "no question is open that this would answer"
    if now.fault is not None:
        return "a fault waits for somebody to say how to go on"
    return "the run does not rest"
