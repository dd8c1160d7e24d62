"""``hexacell tui``: the technician's screen."""

from __future__ import annotations

import argparse
import gc
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.errors import ExitCode, UsageError
from hexacell.screen.app import FirstCell, TechnicianApp
from hexacell.screen.key_map import preferences_path, read_preferences
from hexacell.screen.terminal_watch import end_with_terminal

if TYPE_CHECKING:
    from hexacell.screen.assistant_screen import Assistant
    from hexacell.screen.backend import Backend


def main(options: argparse.Namespace) -> ExitCode:
    """Show the screen until the person leaves it; then the process ends at once.

    Raises:
        UsageError: there is no terminal.
        FileError: the key map cannot be read.
    """
    _require_terminal()
    end_with_terminal(sys.stdin.fileno())
    path: Path = options.cell
    first = None if path.exists() else FirstCell(path, partial(_assistant, path))
    app = TechnicianApp(partial(_session, path), read_preferences(preferences_path()), first_cell=first)
    app.run()
    if app.return_code:
        return ExitCode.FAULT  # Textual has said why
    # Everything is closed; to take all modules apart would last half a second more.
    sys.stdout.flush()
    os._exit(int(ExitCode.DONE))


def _require_terminal() -> None:
    """Refuse what Textual would draw on all the same; raises ``UsageError``."""
    action = "Use `hexacell run`, which asks line by line"
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("the screen needs a terminal, and this is none", action=action)
    if os.environ.get("TERM") == "dumb":
        raise UsageError("this terminal cannot draw a screen (TERM is dumb)", action=action)


def _assistant(path: Path) -> Assistant:
    from hexacell.screen.assistant import FirstCellAssistant  # noqa: PLC0415 - behind the first screen

    return FirstCellAssistant(path)


def _session(path: Path) -> Backend:
    """Loaded behind the first screen: numpy and scipy take a second."""
    from hexacell.screen.cell_workplace import CellWorkplace  # noqa: PLC0415
    from hexacell.screen.session import ScreenSession  # noqa: PLC0415

    session = ScreenSession(CellWorkplace(path))
    gc.freeze()  # what is loaded stays: to look through it for garbage would keep a key waiting for 0.1 s
    return session
