"""``hexacell tui``: the technician's screen."""

from __future__ import annotations

import argparse
import os
import select
import sys
import threading
from pathlib import Path

from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.screen.app import TechnicianApp
from hexacell.screen.first_values import FirstValues
from hexacell.screen.preferences import preferences_path, read_preferences

THREADS_YIELD_AFTER_S = 0.0005
"""How soon a thread that computes lets the screen go on, s: keys are heard while the rest is loaded."""


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
    sys.setswitchinterval(THREADS_YIELD_AFTER_S)
    path: Path = options.cell
    values = FirstValues(path)
    app = TechnicianApp(
        values.model,
        read_preferences(preferences_path()),
        first_cell=None if path.exists() else path,
        first_values=values,
    )
    app.run()
    if app.return_code:
        return ExitCode.FAULT  # Textual has said why
    # Everything is closed; to take all modules apart would last half a second more.
    sys.stdout.flush()
    os._exit(int(ExitCode.DONE))


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
