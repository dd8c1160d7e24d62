"""``hexacell notify``: who is notified of unattended runs, whether that works, and what waits."""

import argparse

from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.notify.notice import notice_of_test
from hexacell.services.notify.outbox import notify_test, send_waiting, waiting_notices
from hexacell.text.operation import notifications_document, notifications_text, notify_document, notify_text


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """List, send what waits, or try everybody."""
    cell = cell_at(options.cell, console)
    if not (options.test or options.send):
        settings, waiting = cell.settings.notifications, waiting_notices(cell)
        console.show(notifications_document(settings, waiting), notifications_text(settings, waiting))
        return ExitCode.DONE
    if options.test and not cell.settings.notifications:
        action = "Write [[notifications]]"
        raise UsageError("nobody is notified of its runs", subject=cell.path, action=action)
    outcome = notify_test(cell, notice_of_test(cell)) if options.test else send_waiting(cell)
    console.show(notify_document(outcome), notify_text(outcome))
    return ExitCode.DONE if outcome.are_all_sent else ExitCode.HARDWARE
