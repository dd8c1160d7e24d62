"""Signals while an engine runs: commands to it, never an exception in the middle of a step."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Coroutine, Iterable
from types import FrameType
from typing import Any, TypeVar

from hexacell.cli.console import Console
from hexacell.cli.signals import STOP_SIGNALS, handled
from hexacell.errors import Interruption
from procedures.engine.commands import Abort, CommandQueue, Stop

Result = TypeVar("Result")

ENDING_SIGNALS = (signal.SIGINT, *STOP_SIGNALS)


class SignalCommands:
    """Turns signals into commands: the first is a clean stop, a second Ctrl-C stops motion at once."""

    def __init__(self, console: Console) -> None:
        self.queue = CommandQueue()
        self._console = console
        self._stop_requested = False

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """``asyncio.run`` with signals turned into commands.

        Before an engine reads the queue, a signal cancels the work, which then cleans up. After the
        engine has ended, a signal has no effect.

        Raises:
            Interruption: a signal cancelled the work.
        """
        # An ignored one stays so, as Ctrl-C in a script's background job.
        heeded = [number for number in ENDING_SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
        early: list[int] = []
        try:
            # An exception while the loop is being made would leave a half-made loop behind.
            with handled(heeded, lambda number, _: early.append(number)):
                return asyncio.run(self._with_handlers(work, heeded, early))
        except asyncio.CancelledError:
            raise Interruption("interrupted") from None

    async def _with_handlers(
        self, work: Coroutine[Any, Any, Result], heeded: Iterable[signal.Signals], early: list[int]
    ) -> Result:
        loop, task = asyncio.get_running_loop(), asyncio.ensure_future(work)

        def handle(number: int, _: FrameType | None) -> None:
            loop.call_soon_threadsafe(self._handle, signal.Signals(number), task)

        with handled(heeded, handle):
            for number in early:
                handle(number, None)
            return await task

    def _handle(self, number: signal.Signals, task: asyncio.Task[Any]) -> None:
        if self.queue.is_over:
            return
        if not self.queue.is_attended:
            task.cancel()
        elif self._stop_requested and number is signal.SIGINT:
            self.queue.put(Abort("interrupted"))
        else:
            self._stop(number)

    def _stop(self, number: signal.Signals) -> None:
        self._stop_requested = True
        self.queue.put(Stop("interrupted"))
        if number is signal.SIGINT:
            self._console.print("Stopping after this step; Ctrl-C again stops motion at once.")
