"""``hexacell tui``: the technician's screen."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.errors import ExitCode, UsageError
from hexacell.screen.app import FirstCell, TechnicianApp
from hexacell.screen.key_map import preferences_path, read_preferences

if TYPE_CHECKING:
    from hexacell.screen.assistant_screen import Assistant
    from hexacell.screen.backend import Backend


def main(options: argparse.Namespace) -> ExitCode:
    """Show the screen until the person leaves it.

    Raises:
        UsageError: there is no terminal.
        FileError: the key map cannot be read.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError(
            "the screen needs a terminal, and this is none",
            action="Use `hexacell run`, which asks line by line",
        )
    path: Path = options.cell
    first = None if path.exists() else FirstCell(path, partial(_assistant, path))
    app = TechnicianApp(partial(_session, path), read_preferences(preferences_path()), first_cell=first)
    code = app.run()
    return ExitCode(code or app.return_code or ExitCode.DONE)


def _assistant(path: Path) -> Assistant:
    from hexacell.screen.assistant import FirstCellAssistant  # noqa: PLC0415 - behind the first screen

    return FirstCellAssistant(path)


def _session(path: Path) -> Backend:
    """Loaded behind the first screen: numpy and scipy take a second."""
    from hexacell.screen.cell_workplace import CellWorkplace  # noqa: PLC0415
    from hexacell.screen.session import ScreenSession  # noqa: PLC0415

    return ScreenSession(CellWorkplace(path))
