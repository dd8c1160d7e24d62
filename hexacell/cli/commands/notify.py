"""``hexacell notify``: who is told of unattended runs, whether that works, and what waits."""

from __future__ import annotations

import argparse

from hexacell.cell.loader import Cell
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.notify.run_notices import notice_of_test
from hexacell.services.notify.telling_people import (
    TellingOutcome,
    send_waiting,
    tell_test,
    waiting_notices,
)
from hexacell.text.notices import (
    notifications_document,
    notifications_text,
    telling_document,
    telling_text,
)


def main(options: argparse.Namespace) -> ExitCode:
    """List, send what waits, or try everybody."""
    console = Console(options.json)
    cell = cell_at(options.cell, console)
    if options.test:
        return _told(_tested(cell), console)
    return _told(send_waiting(cell), console) if options.send else _list(cell, console)


def _tested(cell: Cell) -> TellingOutcome:
    if not cell.settings.notifications:
        raise UsageError("nobody is told of its runs", subject=cell.path, action="Write [[notifications]]")
    return tell_test(cell, notice_of_test(cell))


def _list(cell: Cell, console: Console) -> ExitCode:
    settings, waiting = cell.settings.notifications, waiting_notices(cell)
    console.document(notifications_document(settings, waiting))
    console.print(notifications_text(settings, waiting))
    return ExitCode.DONE


def _told(outcome: TellingOutcome, console: Console) -> ExitCode:
    console.document(telling_document(outcome))
    console.print(telling_text(outcome))
    return ExitCode.DONE if outcome.are_all_told else ExitCode.HARDWARE
