"""SIGTERM and SIGHUP do what Ctrl-C does, in every command. Imports nothing slow."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType

STOP_SIGNALS = tuple(
    number for name in ("SIGTERM", "SIGHUP") if (number := getattr(signal, name, None)) is not None
)
"""Sent by a service manager, or when the terminal is closed. Windows has no SIGHUP."""


@contextmanager
def handled(
    numbers: Iterable[signal.Signals], handler: Callable[[int, FrameType | None], object]
) -> Iterator[None]:
    """Handle signals within this context.

    Python handles signals in the main thread only; elsewhere nothing changes.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, handler) for number in numbers} if in_main_thread else {}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


def stop_signals_as_sigint() -> AbstractContextManager[None]:
    """Let SIGTERM and SIGHUP do what Ctrl-C does: motion stops, devices and files are released.

    A signal that is already handled or ignored, as under ``nohup``, is left alone.
    """
    free = [number for number in STOP_SIGNALS if signal.getsignal(number) is signal.SIG_DFL]
    return handled(free, _forward_to_sigint)


def _forward_to_sigint(_number: int, frame: FrameType | None) -> None:
    # Within asyncio.run this is the loop's own handler, which cancels the running task. It is not
    # callable in a script's background job, where Ctrl-C is ignored.
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):
        raise KeyboardInterrupt
    handler(signal.SIGINT, frame)
