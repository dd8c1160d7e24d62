"""Being told to end: by Ctrl-C, by a service manager, or because the terminal has gone."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

STOPS = (signal.SIGTERM, signal.SIGHUP)


@contextmanager
def every_stop_as_ctrl_c() -> Iterator[None]:
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
