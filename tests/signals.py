"""Signals as a program has them that a person starts at a terminal.

Below ``nohup``, in a script's background job and on some CI runners SIGINT, SIGHUP or SIGTERM are
ignored or blocked, and every child inherits that. A test that sends signals sets what it needs. The
test run itself keeps what it was started with.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGPIPE)
DEFAULTS: dict[signal.Signals, Any] = dict.fromkeys(NUMBERS, signal.SIG_DFL) | {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGPIPE: signal.SIG_IGN,  # Python's own; subprocess gives children the system's default
}


@contextmanager
def terminal_signals() -> Iterator[None]:
    """Within this, signals have their default handlers and none is blocked, also in new processes.

    Only the main thread may change handlers; elsewhere this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.signal(number, handler) for number, handler in DEFAULTS.items()}
    blocked = signal.pthread_sigmask(signal.SIG_SETMASK, ())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for number, handler in handlers.items():
            if handler is not None:  # one that was not set by Python
                signal.signal(number, handler)
