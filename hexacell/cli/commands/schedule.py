"""``hexacell schedule``: a cell is checked or recalibrated each day, by systemd or cron."""

import argparse

from hexacell.cell.loader import Cell
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.schedule.scheduled_run import crontab_line
from hexacell.services.schedule.schedules import (
    present_schedule,
    remove_schedule,
    scheduled_run,
    write_schedule,
)
from hexacell.text import operation
from hexacell.text.documents import schedule_document


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write, show or remove a schedule; nothing is started or stopped."""
    cell = cell_at(options.cell, console)
    if options.show or options.remove:
        found = (present_schedule if options.show else remove_schedule)(cell, options.folder)
        console.show(
            schedule_document(found),
            (operation.present_schedule_text if options.show else operation.removed_schedule_text)(found),
        )
    elif options.daily is None:
        raise UsageError("the time of day is missing", action="Give --daily 02:30, --show or --remove")
    else:
        _write(cell, options, console)
    return ExitCode.DONE


def _write(cell: Cell, options: argparse.Namespace, console: Console) -> None:
    run = scheduled_run(cell, options.daily, options.mode, options.on_failure, options.metrics)
    stated = cell.settings.unattended
    if options.cron:
        if options.on_failure is not None:
            raise UsageError("only systemd starts a unit on a failure", action="Leave --on-failure away")
        line = crontab_line(run)
        console.show({"crontab": line}, operation.crontab_text(line, stated))
        return
    written = write_schedule(run, options.folder)
    console.show(schedule_document(written), operation.written_schedule_text(written, run, stated))
