"""SIGTERM and SIGHUP do what Ctrl-C does, in every command. Imports nothing slow."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

STOP_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Sent by a service manager, or when the terminal is closed."""


@contextmanager
def stop_signals_as_sigint() -> Iterator[None]:
    """Let SIGTERM and SIGHUP do what Ctrl-C does: motion stops, devices and files are released.

    A signal that is already handled or ignored, as under ``nohup``, is left alone. Python handles
    signals in the main thread only; elsewhere nothing changes.
    """
    taken = [number for number in STOP_SIGNALS if _is_default(number)]
    try:
        for number in taken:
            signal.signal(number, _forward_to_sigint)
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _is_default(number: signal.Signals) -> bool:
    return in_main_thread() and signal.getsignal(number) is signal.SIG_DFL


def in_main_thread() -> bool:
    """Whether this thread may install signal handlers."""
    return threading.current_thread() is threading.main_thread()


def _forward_to_sigint(_number: int, frame: FrameType | None) -> None:
    # Within asyncio.run this is the loop's own handler, which cancels the running task. It is not
    # callable in a script's background job, where Ctrl-C is ignored.
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):
        raise KeyboardInterrupt
    handler(signal.SIGINT, frame)
