"""Signals while an engine runs: commands to it, never an exception in the middle of something.

Being told to end: by Ctrl-C, by a service manager, or because the terminal has gone.
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

from hexacell.cli.console import Console
from hexacell.errors import Interruption
from procedures.run.commands import Abort, CommandQueue, Stop

Result = TypeVar("Result")

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Signals:
    """Turns signals into commands: the first is a clean stop, a second Ctrl-C stops motion at once."""

    def __init__(self, console: Console) -> None:
        self.inbox = CommandQueue()
        self._console = console
        self._told = False

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """``asyncio.run``, with signals heeded.

        Until an engine attends to the inbox, a signal cancels the work, which then cleans up; when it
        has ended, a signal changes nothing any more.

        Raises:
            Interruption: the work was cancelled so.
        """
        try:
            return asyncio.run(self._heeding(work))
        except asyncio.CancelledError:
            raise Interruption("interrupted") from None

    async def _heeding(self, work: Coroutine[Any, Any, Result]) -> Result:
        loop, task = asyncio.get_running_loop(), asyncio.ensure_future(work)

        def hear(number: int, _: FrameType | None) -> None:
            loop.call_soon_threadsafe(self._hear, signal.Signals(number), task)

        with _handled(hear):
            return await task

    def _hear(self, number: signal.Signals, task: asyncio.Task[Any]) -> None:
        if self.inbox.is_over:
            return
        if not self.inbox.is_attended:
            task.cancel()
        elif self._told and number is signal.SIGINT:
            self.inbox.put(Abort("interrupted"))
        else:
            self._stop(number)

    def _stop(self, number: signal.Signals) -> None:
        self._told = True
        self.inbox.put(Stop("interrupted"))
        if number is signal.SIGINT:
            self._console.say("Stopping after this step; Ctrl-C again stops motion at once.")


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Handle what ends a program, but not what is ignored, as in a script's background job."""
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {n: signal.getsignal(n) for n in ENDS if signal.getsignal(n) is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


STOPS = (signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stop_signals_as_sigint() -> Iterator[None]:
    """Have SIGTERM and SIGHUP do what Ctrl-C does: motion stops, devices and files are let go.

    A signal that somebody ignores or handles already is left alone (``nohup`` does so). Signals can
    be had in the main thread only; elsewhere nothing is changed.
    """
    taken = [number for number in STOPS if _is_free(number)]
    try:
        for number in taken:
            signal.signal(number, _as_ctrl_c)
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _is_free(number: signal.Signals) -> bool:
    in_main_thread = threading.current_thread() is threading.main_thread()
    return in_main_thread and signal.getsignal(number) is signal.SIG_DFL


def _as_ctrl_c(_number: int, frame: FrameType | None) -> None:
    # Within asyncio.run this is the loop's own handler, which cancels what runs. It is none in a
    # shell script's background job, where Ctrl-C is ignored.
    ctrl_c = signal.getsignal(signal.SIGINT)
    if not callable(ctrl_c):
        raise KeyboardInterrupt
    ctrl_c(signal.SIGINT, frame)
