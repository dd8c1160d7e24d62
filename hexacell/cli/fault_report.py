"""A fault of the program itself: kept in a file for its developers, and told in one line."""

from __future__ import annotations

import os
import platform
import shlex
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

from hexacell import __version__


def fault_line(error: Exception, typed: Sequence[str]) -> str:
    """The line that tells a person of a fault, once it is kept in a file that only this user can read."""
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    line = f"this is a fault of the program: {' '.join(what.split())}"
    try:
        kept = _keep(error, typed)
    except OSError as refusal:
        return f"{line}. No report could be written: {refusal.strerror}"
    return f"{line}. Please report it with {kept}"


def _keep(error: Exception, typed: Sequence[str]) -> Path:
    handle, name = tempfile.mkstemp(prefix="hexacell-fault-", suffix=".txt")
    head = f"hexacell {__version__}, Python {platform.python_version()}, {platform.platform()}\n"
    command = f"hexacell {shlex.join(typed)}\n"
    with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as report:
        report.write(head + command + "".join(traceback.format_exception(error)))
    return Path(name)
