"""Running a coroutine while commands are taken: some cancel it, the others wait for its end.

The flags that the commands set decide the status of the engine.
"""

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import reduce
from typing import Any, TypeVar

from hexacell.errors import UsageError
from procedures.engine import commands
from procedures.run.cancellation import cancel_and_wait
from procedures.run.state import RunState, apply

Result = TypeVar("Result")


class Status(StrEnum):
    """What an engine is doing, for screens."""

    IDLE = "idle"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    AWAITING_OPERATOR = "awaiting operator"
    STOPPING = "stopping"
    ENDED = "ended"
    FAULTED = "faulted"


@dataclass(frozen=True, slots=True)
class EngineFlags:
    """Facts about the engine; several may hold at once.

    Attributes:
        fault: what failed, until it is decided how to continue.
        asking: a question waits for a person.
        pausing: a pause is wanted, ``at_once`` in mid-step; ``paused``: it has begun.
        stopping: why the run is to end; nothing where it is not.
        returning: why it is to end as soon as the robot is back at a reference.
    """

    begun: bool = False
    ended: bool = False
    fault: str | None = None
    asking: bool = False
    pausing: bool = False
    at_once: bool = False
    paused: bool = False
    stopping: str | None = None
    returning: str | None = None

    @property
    def status(self) -> Status:
        """The most severe fact decides; a fault stays until it is cleared, also after the end."""
        words = (
            (self.fault is not None, Status.FAULTED),
            (self.ended, Status.ENDED),
            (self.stopping is not None or self.returning is not None, Status.STOPPING),
            (self.paused, Status.PAUSED),
            (self.asking, Status.AWAITING_OPERATOR),
            (self.pausing, Status.PAUSING),
            (self.begun, Status.RUNNING),
        )
        return next((status for holds, status in words if holds), Status.IDLE)


class StepCancelled(Exception):
    """A command cancelled the coroutine; the flags say which."""


@dataclass(eq=False)
class CommandLoop:
    """Takes commands out of the queue and keeps the flags that they set.

    ``state`` gives the present state of the run; ``reject`` is called with each refused command, and why.
    """

    queue: commands.CommandQueue
    broker: commands.QuestionBroker
    state: Callable[[], RunState]
    reject: Callable[[commands.Command, str], None]
    flags: EngineFlags = EngineFlags()
    watchers: list[Callable[[Status], None]] = field(default_factory=list)
    _invalidations: list[commands.Invalidation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.broker.watchers.append(lambda question: self.set_flags(asking=question is not None))

    def set_flags(self, **flags: Any) -> None:  # noqa: ANN401 - the fields of EngineFlags
        """Set flags; watchers are called if the status changes by that."""
        before = self.flags.status
        self.flags = replace(self.flags, **flags)
        if (now := self.flags.status) is not before:
            for watcher in self.watchers:
                watcher(now)

    async def run_cancellable(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Run a coroutine to its end, taking commands; raises ``StepCancelled`` if one cancelled it."""
        task, listening = asyncio.ensure_future(work), asyncio.ensure_future(self._until_cancelled())
        try:
            await asyncio.wait([task, listening], return_when=asyncio.FIRST_COMPLETED)
        finally:
            try:
                await cancel_and_wait(listening)
            finally:
                await cancel_and_wait(task)
        was_commanded = not listening.cancelled()
        if was_commanded:
            listening.result()
        if was_commanded and task.cancelled():
            raise StepCancelled
        return task.result()

    async def take_one(self) -> None:
        """Wait for a command and take it."""
        self._take(await self.queue.next())

    def catch_up(self) -> None:
        """Take the commands that wait."""
        for command in self.queue.take():
            self._take(command)

    def take_invalidations(self) -> list[commands.Invalidation]:
        """What commands made invalid, oldest first, of the records of then; only once."""
        taken, self._invalidations = self._invalidations, []
        return taken

    async def _until_cancelled(self) -> None:
        while not self._take(await self.queue.next()):
            pass

    def _take(self, command: commands.Command) -> bool:
        """Take one command; whether it cancels what is running."""
        flags = self.flags
        match command:
            case commands.Stop():
                self.set_flags(stopping=flags.stopping or command.reason)
                return flags.asking
            case commands.EndAtReference():
                self.set_flags(returning=flags.returning or command.reason)
                return flags.asking
            case commands.Abort():
                self.set_flags(stopping=command.reason)
                return True
            case commands.Pause() if flags.fault is None:
                self.set_flags(pausing=True, at_once=flags.at_once or command.at_once)
                return command.at_once or flags.asking
            case commands.Resume() if flags.paused or flags.pausing:
                self.set_flags(pausing=False, at_once=False, paused=False)
            case commands.Answer() if self.broker.answer(command.value):
                pass
            case commands.Undo() | commands.MeasureAgain():
                return self._invalidate(command) and flags.asking and flags.fault is None
            case _:
                self.reject(command, _refusal(command, flags))
        return False

    def _invalidate(self, command: commands.Undo | commands.MeasureAgain) -> bool:
        """Request what the command asks for; whether it is possible."""
        expected = reduce(apply, self._invalidations, self.state())
        try:
            self._invalidations.append(commands.invalidation_event(command, expected))
        except UsageError as refusal:
            self.reject(command, str(refusal))
            return False
        return True


def _refusal(command: commands.Command, flags: EngineFlags) -> str:
    if isinstance(command, commands.Answer):
        return "no question is open that this would answer"
    if flags.fault is not None:
        return "a fault waits for a decision on how to continue"
    return "the run is not paused"
