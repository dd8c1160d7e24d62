"""Runs that nobody watches: when they begin, who hears of them; ``hexacell schedule`` and ``notify``."""

import argparse
import asyncio
from collections.abc import Callable
from typing import Any

from hexacell.cell.loader import Cell
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.cli.terminal import SignalCommands
from hexacell.errors import ExitCode, FileError, HexacellError, UsageError
from hexacell.services.history.cell_status import cell_status, publish_status
from hexacell.services.run.calibration_run import RunRequest
from hexacell.services.unattended.notice import RunEnd, notice_of_end, notice_of_failure, notice_of_test
from hexacell.services.unattended.outbox import notify_all, notify_test, send_waiting, waiting_notices
from hexacell.services.unattended.scheduled_run import crontab_line
from hexacell.services.unattended.schedules import (
    Schedule,
    present_schedule,
    remove_schedule,
    scheduled_run,
    write_schedule,
)
from hexacell.services.unattended.unattended_runs import local_now, refuse_quiet_hours, refused_start
from hexacell.text import operation
from hexacell.text.layout import duration
from procedures.steps import events


def begun_in_window(
    request: RunRequest, console: Console, begin: Callable[[], events.Ended]
) -> events.Ended:
    """Begin a run; where that is refused, note why, wait, and try again while its window is open.

    Raises:
        Interruption: a signal ended it.
        HexacellError: the last refusal, or what ended the run.
    """
    if not request.keeps_hours:
        return begin()
    began = local_now()
    while True:
        try:
            refuse_quiet_hours(request.cell.settings, local_now())
            return begin()
        except HexacellError as error:
            if request.folder.journal.is_file():
                raise  # it had begun: its journal says the rest
            wait_s = refused_start(request, error, began, local_now())
            if wait_s is None:
                raise
            console.warn(f"{error}\nnot begun; tried again in {duration(wait_s / 60.0)}")
            SignalCommands(console).run(asyncio.sleep(wait_s))


def notified_afterwards(request: RunRequest, console: Console, run: Callable[[], RunEnd]) -> RunEnd:
    """Carry out an unattended run, then notify people of its end, or of the error that ended it.

    The outcome of the run stays what it is, whatever goes wrong here.
    """
    try:
        end = run()
    except Exception as error:
        _notify(request, console, error)
        _publish(request.cell, console)
        raise
    _notify(request, console, end)
    _publish(request.cell, console)
    return end


def _publish(cell: Cell, console: Console) -> None:
    """Put the state of the cell into the archive that it shares; warn in one line where that fails."""
    if cell.settings.archive.url is None:
        return
    try:
        publish_status(cell_status(cell))
    except FileError as error:
        console.warn(" ".join(str(error).split()))
    except Exception as fault:
        console.warn(f"the shared archive is as it was before this run ({type(fault).__name__})")


def _notify(request: RunRequest, console: Console, end: RunEnd | Exception) -> None:
    if not request.unattended or not request.cell.settings.notifications:
        return
    try:
        notice = notice_of_end(end) if isinstance(end, RunEnd) else notice_of_failure(request, end)
        line = operation.notify_line(notify_all(request.cell, notice))
    except KeyboardInterrupt:
        line = f"not notified: interrupted ({operation.NEXT_TIME})"
    except Exception as fault:
        line = f"not notified: a fault of the program ({type(fault).__name__})"
    if line is not None:
        console.warn(line)


def schedule(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write, show or remove a schedule; nothing is started or stopped."""
    cell = cell_at(options.cell, console)
    if options.show or options.remove:
        found = (present_schedule if options.show else remove_schedule)(cell, options.folder)
        console.show(
            _schedule_document(found),
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
    console.show(_schedule_document(written), operation.written_schedule_text(written, run, stated))


def _schedule_document(schedule: Schedule | None) -> dict[str, Any]:
    return {
        "unit": schedule and schedule.unit,
        "files": schedule.files if schedule else [],
        "complaints": schedule.complaints if schedule else [],
    }


def notify(options: argparse.Namespace, console: Console) -> ExitCode:
    """List, send what waits, or try everybody."""
    cell = cell_at(options.cell, console)
    if not (options.test or options.send):
        settings, waiting = cell.settings.notifications, waiting_notices(cell)
        console.show(
            {"notifications": [{"name": one.name, "on": one.on} for one in settings], "waiting": waiting},
            operation.notifications_text(settings, waiting),
        )
        return ExitCode.DONE
    if options.test and not cell.settings.notifications:
        action = "Write [[notifications]]"
        raise UsageError("nobody is notified of its runs", subject=cell.path, action=action)
    outcome = notify_test(cell, notice_of_test(cell)) if options.test else send_waiting(cell)
    recipients = [
        {"name": one.name, "told": one.sent, "wait": one.wait, "problem": one.problem}
        for one in outcome.deliveries
    ]
    console.show({"told": recipients, "dropped": outcome.dropped}, operation.notify_text(outcome))
    return ExitCode.DONE if outcome.are_all_sent else ExitCode.HARDWARE
