"""``hexacell tui``: the technician's screen."""

from __future__ import annotations

import argparse
import gc
import os
import select
import sys
import threading
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.screen.app import TechnicianApp
from hexacell.screen.preferences import preferences_path, read_preferences

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Show the screen until the person leaves it, or serve it; then the process ends at once.

    Raises ``UsageError`` without a terminal, ``FileError`` if the key map cannot be read.
    """
    if options.serve is not None:
        from hexacell.cli.commands.serve import screen  # noqa: PLC0415 - slow, and only of use here

        return screen(options, console)
    action = "Use `hexacell run`, which asks line by line"
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("the screen needs a terminal", action=action)
    if os.environ.get("TERM") == "dumb":
        raise UsageError("this terminal cannot draw a screen (TERM is dumb)", action=action)
    return page(options, console)


def page(options: argparse.Namespace, _: Console) -> ExitCode:
    """Show the screen at this terminal, or to the server that has started this process for a browser."""
    end_with_terminal(sys.stdin.fileno())
    path: Path = options.cell
    app = TechnicianApp(
        partial(_model, path),
        read_preferences(preferences_path()),
        first_cell=None if path.exists() else path,
    )
    app.run()
    if app.return_code:
        return ExitCode.FAULT  # Textual has said why
    # Everything is closed; to take all modules apart would last half a second more.
    sys.stdout.flush()
    os._exit(int(ExitCode.DONE))


def _model(path: Path) -> ScreenModel:
    """Loaded behind the first screen: numpy and scipy take a second."""
    from hexacell.screen.model import ScreenModel  # noqa: PLC0415
    from hexacell.screen.workplace import Workplace  # noqa: PLC0415

    model = ScreenModel(Workplace(path))
    gc.freeze()  # what is loaded stays: to look through it for garbage would keep a key waiting for 0.1 s
    return model


def end_with_terminal(terminal: int) -> None:
    """End this process as soon as a terminal, or a server in its place, is gone, signal or not.

    What is drawn then can be written nowhere: Textual's queue of it fills, and the process would wait for
    ever. Its run notices that nobody is there, and pauses.
    """

    def wait_and_end() -> None:
        waiting = select.poll()
        waiting.register(terminal, 0)  # a hang-up is reported even where nothing is asked for
        waiting.poll()
        os._exit(int(ExitCode.INTERRUPTED))

    threading.Thread(target=wait_and_end, daemon=True).start()
