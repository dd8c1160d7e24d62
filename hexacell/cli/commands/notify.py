"""``hexacell notify``: who is told of unattended runs, whether that works, and what waits."""

from __future__ import annotations

import argparse

from hexacell.cell.loader import Cell
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.notify.notice import notice_of_test
from hexacell.services.notify.outbox import (
    NotifyOutcome,
    notify_test,
    send_waiting,
    waiting_notices,
)
from hexacell.text.notices import (
    notifications_document,
    notifications_text,
    notify_document,
    notify_text,
)


def main(options: argparse.Namespace) -> ExitCode:
    """List, send what waits, or try everybody."""
    console = Console(options.json)
    cell = cell_at(options.cell, console)
    if options.test:
        return _told(_tested(cell), console)
    return _told(send_waiting(cell), console) if options.send else _list(cell, console)


def _tested(cell: Cell) -> NotifyOutcome:
    if not cell.settings.notifications:
        action = "Write [[notifications]]"
        raise UsageError("nobody is notified of its runs", subject=cell.path, action=action)
    return notify_test(cell, notice_of_test(cell))


def _list(cell: Cell, console: Console) -> ExitCode:
    settings, waiting = cell.settings.notifications, waiting_notices(cell)
    console.document(notifications_document(settings, waiting))
    console.print(notifications_text(settings, waiting))
    return ExitCode.DONE


def _told(outcome: NotifyOutcome, console: Console) -> ExitCode:
    console.document(notify_document(outcome))
    console.print(notify_text(outcome))
    return ExitCode.DONE if outcome.are_all_sent else ExitCode.HARDWARE
