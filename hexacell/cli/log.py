"""The log of what the program does, where it is asked for: in a file, or on stderr.

It stands beside the journal of a run and replaces no part of it. Every package logs to loggers of its own
modules: ``hexacell``, ``procedures`` and ``drivers`` with ``drivers.wire``, the bytes on the lines.
"""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hexacell.errors import FileError

PACKAGES = ("hexacell", "procedures", "drivers")
FORMAT = "%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s: %(message)s"


@contextmanager
def log(file: Path | None, verbosity: int) -> Iterator[None]:
    """Log within this context: to a file, or with ``verbosity`` alone to stderr.

    The level is INFO; it is DEBUG, with the bytes on the lines, where both are given or ``verbosity`` is 2.

    Raises:
        FileError: the file cannot be written.
    """
    try:
        handler = logging.StreamHandler() if file is None else logging.FileHandler(file, encoding="utf-8")
    except OSError as error:
        problem = f"the log cannot be written: {error.strerror or error}"
        raise FileError(problem, subject=file, action="Name another file") from error
    formatter = logging.Formatter(FORMAT, "%Y-%m-%dT%H:%M:%S")
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
