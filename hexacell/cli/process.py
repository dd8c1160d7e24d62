"""What every command needs of its process: signals, the platform, its log, reports of its faults.

SIGTERM does what Ctrl-C does, and so does every other signal that would end the process without a word.
``docs/howto-host.md`` says what is tested where. Nothing
slow is imported.
"""

import logging
import os
import platform
import shlex
import signal
import socket
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from importlib.util import find_spec
from types import FrameType

from hexacell import __version__
from hexacell.errors import FileError, UsageError
from hexacell.printable import PrintableFormatter, printable
from hexacell.storage.output_files import OutputFile

_ENDING = "TERM HUP QUIT USR1 USR2 ALRM VTALRM PROF IO XCPU PWR STKFLT"

STOP_SIGNALS: tuple[int, ...] = tuple(
    number for name in _ENDING.split() if (number := getattr(signal, f"SIG{name}", None)) is not None
) + tuple(range(getattr(signal, "SIGRTMIN", 0), getattr(signal, "SIGRTMAX", -1) + 1))
"""Sent by a service manager, a script or a person, or when the terminal is closed; Windows has few.

Unhandled, each ends the process, and a robot would go on with its move, unwatched. Faults are left alone.
"""

OVER_A_SOCKET = {"tui.main", "tui.page", "host.main"}
"""Commands that run, or reach, a run in another process."""


@contextmanager
def handled(
    numbers: Iterable[int], handler: Callable[[int, FrameType | None], object] | signal.Handlers
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
    """Let ``STOP_SIGNALS`` do what Ctrl-C does: motion stops, devices and files are released.

    A signal that is already handled or ignored, as under ``nohup``, is left alone.
    """
    free = [number for number in STOP_SIGNALS if signal.getsignal(number) is signal.SIG_DFL]
    return handled(free, forward_to_sigint)


def forward_to_sigint(_number: int, frame: FrameType | None) -> None:
    """Do what Ctrl-C does."""
    # Within asyncio.run this is the loop's own handler, which cancels the running task. It is not
    # callable in a script's background job, where Ctrl-C is ignored.
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):
        raise KeyboardInterrupt
    handler(signal.SIGINT, frame)


def fault_line(error: Exception, typed: Sequence[str]) -> str:
    """The line for a person about a fault, which is kept in a file that only this user can read."""
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    line = f"this is a fault of the program: {' '.join(what.split())}"
    try:
        handle, name = tempfile.mkstemp(prefix="hexacell-fault-", suffix=".txt")
        head = f"hexacell {__version__}, Python {platform.python_version()}, {platform.platform()}\n"
        head += f"hexacell {shlex.join(typed)}\n"
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as report:
            report.write(printable(head + "".join(traceback.format_exception(error))))
    except OSError as refusal:
        return f"{line}. No report could be written: {refusal.strerror}"
    return f"{line}. Please report it with {name}"


def require_platform(target: str) -> None:
    """Refuse a command, by module and function, that this operating system cannot carry out.

    Nothing of it is imported. Raises ``UsageError`` without POSIX locks and terminals (Windows), or without
    a report of who is at the other end of a local socket, as Linux has it (macOS).
    """
    if target != "completion.main" and find_spec("fcntl") is None:
        raise UsageError(
            "this system has no POSIX file locks, terminals and signals, by which hexacell protects a cell",
            action="Use Linux; on Windows install it there with `wsl --install`",
        )
    if target in OVER_A_SOCKET and not hasattr(socket, "SO_PEERCRED"):
        raise UsageError(
            "this system does not report as Linux does who is at the other end of a local socket, without "
            "which nobody may reach a run in another process",
            action="Use `hexacell run` at this terminal, or Linux",
        )


PACKAGES = ("hexacell", "procedures", "drivers")
FORMAT = "%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s: %(message)s"


@contextmanager
def log(file: OutputFile | None, verbosity: int) -> Iterator[None]:
    """Log within this context: to a file, or with ``verbosity`` alone to stderr; raises ``FileError``.

    The log stands beside the journal of a run and replaces no part of it. Every module logs to a logger of
    its own; ``drivers.wire`` has the bytes on the lines. The level is INFO; it is DEBUG, with the bytes on
    the lines, where both are given or ``verbosity`` is 2.
    """
    try:
        stream = None if file is None else os.fdopen(file.open_stream(appends=True), "a", encoding="utf-8")
    except OSError as error:
        problem = f"the log cannot be written: {error.strerror or error}"
        raise FileError(problem, subject=file.path if file else None, action="Name another file") from error
    handler = logging.StreamHandler(stream)
    formatter = PrintableFormatter(FORMAT, "%Y-%m-%dT%H:%M:%S")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    level = logging.DEBUG if verbosity + (file is not None) > 1 else logging.INFO
    shows_errors, logging.raiseExceptions = logging.raiseExceptions, False  # a full disk stops no run
    loggers = [logging.getLogger(package) for package in PACKAGES]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(level)
    try:
        yield
    finally:
        logging.raiseExceptions = shows_errors
        for logger in loggers:
            logger.removeHandler(handler)
            logger.setLevel(logging.NOTSET)
        handler.close()
        if stream is not None:
            with suppress(OSError):  # it tries once more what a full disk has not taken
                stream.close()
