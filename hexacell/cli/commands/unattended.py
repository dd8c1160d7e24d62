"""Runs that nobody watches: when they begin, who hears of them; ``hexacell schedule`` and ``notify``."""

import argparse
import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from hexacell.cell.loader import Cell
from hexacell.cell.operation import NotificationSettings, UnattendedSettings, scheme_of
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.cli.terminal import SignalCommands
from hexacell.errors import ExitCode, FileError, HexacellError, UsageError
from hexacell.plugins import plugin_failures_named
from hexacell.services.history.cell_status import cell_status, publish_status
from hexacell.services.run.calibration_run import RunRequest
from hexacell.services.unattended import outbox
from hexacell.services.unattended.notice import (
    PendingNotice,
    RunEnd,
    notice_of_end,
    notice_of_failure,
    notice_of_test,
)
from hexacell.services.unattended.scheduled_run import ScheduledRun, skipped_day
from hexacell.services.unattended.schedules import (
    Schedule,
    present_schedule,
    remove_schedule,
    scheduled_run,
    write_schedule,
)
from hexacell.services.unattended.unattended_runs import local_now, refuse_quiet_hours, refused_start
from hexacell.storage.atomic_files import read_text
from hexacell.text.layout import duration, wrapped
from procedures.journal.journal import is_evidence_lost
from procedures.steps import events

NOBODY = "nobody is notified; write [[notifications]] in the cell file"
NEXT_TIME = "sent at the next run, or by hexacell notify CELL --send"
MEANING = {
    "check": "It measures a few records and changes nothing.",
    "quick": "It corrects what has drifted since the last result; the config is changed only if every gate "
    "is passed.",
    "optimise": "It recalibrates; the config is changed only if every gate is passed.",
}
"""What a scheduled run of each mode does."""


def begun_in_window(
    request: RunRequest, console: Console, begin: Callable[[], events.Ended]
) -> events.Ended:
    """Begin a run; where that is refused, note why, wait, and try again while its window is open.

    Raises ``Interruption`` after a signal, else the last refusal, or what ended the run.
    """
    if not request.keeps_hours:
        return begin()
    began = local_now()
    while True:
        try:
            refuse_quiet_hours(request.cell.settings, local_now())
            return begin()
        except HexacellError as error:
            if request.folder.journal.is_file() or is_evidence_lost(error):
                raise  # it had begun: its journal says the rest
            if (wait_s := refused_start(request, error, began, local_now())) is None:
                raise
            console.warn(f"{error}\nnot begun; tried again in {duration(wait_s / 60.0)}")
            SignalCommands(console).run(asyncio.sleep(wait_s))


def notified_afterwards(request: RunRequest, console: Console, run: Callable[[], RunEnd]) -> RunEnd:
    """Carry out an unattended run, then notify people of its end, or of the error that ended it.

    The outcome of the run stays what it is, whatever goes wrong here.
    """
    try:
        with plugin_failures_named():
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
        line = notify_line(outbox.notify_all(request.cell, notice))
    except KeyboardInterrupt:
        line = f"not notified: interrupted ({NEXT_TIME})"
    except Exception as fault:
        line = f"not notified: a fault of the program ({type(fault).__name__})"
    if line is not None:
        console.warn(line)


def schedule(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write, show or remove a schedule; nothing is started or stopped."""
    cell = cell_at(options.cell, console)
    if options.show or options.remove:
        found = (present_schedule if options.show else remove_schedule)(cell, options.folder)
        console.show(_schedule_document(found), _schedule_text(found, is_removed=options.remove))
    elif options.daily is None:
        raise UsageError("the time of day is missing", action="Give --daily 02:30, --show or --remove")
    else:
        run = scheduled_run(cell, options.daily, options.mode, options.metrics and options.metrics.path)
        if (day := skipped_day(run.hour, run.minute, local_now().date())) is not None:
            console.warn(
                f"{options.daily} is not there on {day}, as clocks go forward; that night nothing begins. "
                f"Take {(run.hour + 1) % 24:02}:{run.minute:02}, or set the computer's zone to UTC"
            )
        written = write_schedule(run, options.folder)
        console.show(
            _schedule_document(written), written_schedule_text(written, run, cell.settings.unattended)
        )
    return ExitCode.DONE


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
        settings, waiting = cell.settings.notifications, outbox.waiting_notices(cell)
        console.show(
            {"notifications": [{"name": one.name, "on": one.on} for one in settings], "waiting": waiting},
            notifications_text(settings, waiting),
        )
        return ExitCode.DONE
    if options.test and not cell.settings.notifications:
        action = "Write [[notifications]]"
        raise UsageError("nobody is notified of its runs", subject=cell.path, action=action)
    outcome = outbox.notify_test(cell, notice_of_test(cell)) if options.test else outbox.send_waiting(cell)
    recipients = [
        {"name": one.name, "told": one.sent, "wait": one.wait, "problem": one.problem}
        for one in outcome.deliveries
    ]
    lines = [f"{one.name}: {one.problem or f'notified ({one.sent})'}" for one in outcome.deliveries]
    text = "\n".join([*lines, *_dropped(outcome)] or ["nothing waits"])
    console.show({"told": recipients, "dropped": outcome.dropped}, text)
    return ExitCode.DONE if outcome.are_all_sent else ExitCode.HARDWARE


def notify_line(outcome: outbox.NotifyOutcome) -> str | None:
    """What went wrong, in one line; None if nothing did."""
    problems = [
        f"{one.name}: {one.problem}{f', {one.wait} wait' if one.wait > 1 else ''}"
        for one in outcome.deliveries
        if one.problem
    ]
    problems += _dropped(outcome)
    if not problems:
        return None
    waits = any(one.wait for one in outcome.deliveries)
    return f"not notified: {'; '.join(problems)}{f' ({NEXT_TIME})' if waits else ''}"


def _dropped(outcome: outbox.NotifyOutcome) -> list[str]:
    return [f"{outcome.dropped} notices were given up: too old, or too many"] if outcome.dropped else []


def notifications_text(settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]) -> str:
    """Who is notified of what, and what waits."""
    lines = [
        f"{one.name}: "
        f"{'as its password_file or the environment has it' if one.url is None else scheme_of(one.url)}; "
        f"{', '.join(one.on)}"
        for one in settings
    ]
    lines += [f"waits for {one.to}: {one.notice.at:%Y-%m-%d %H:%M} {one.notice.line}" for one in waiting]
    return "\n".join(lines) or NOBODY


def written_schedule_text(schedule: Schedule, run: ScheduledRun, stated: UnattendedSettings) -> str:
    """What was written, in words, and how it is put in force."""
    kind = "quick level" if run.mode == "quick" else run.mode
    explanation = (
        f"Each day at {run.hour:02}:{run.minute:02} a {kind} begins. {MEANING[run.mode]} "
        f"{_again(run, stated)}{_ending(run, stated)}A day that the computer was off is made up for."
    )
    control = _control(schedule)
    lines = [
        *map(str, schedule.files),
        wrapped(explanation),
        *(f"systemd: {complaint}" for complaint in schedule.complaints),
        "To put it in force:",
        f"  {control} daemon-reload",
        f"  {control} enable --now {schedule.unit}.timer",
    ]
    if not schedule.is_of_system:
        lines.append("  loginctl enable-linger    # else it runs only while you are logged in")
    user = "" if schedule.is_of_system else "--user "
    return "\n".join([*lines, "To see how it went:", f"  journalctl {user}-u {schedule.unit}"])


def _again(run: ScheduledRun, stated: UnattendedSettings) -> str:
    if stated.window_minutes:
        return (
            f"Where it cannot begin (a device, the lock, quiet hours) it is tried again every "
            f"{stated.retry_minutes:g} minutes, for {stated.window_minutes:g} minutes. "
        )
    if not run.retries:
        return ""
    return (
        f"A device or lock that is not there is tried again {run.retries} times, every "
        f"{run.retry_minutes} minutes. "
    )


def _ending(run: ScheduledRun, stated: UnattendedSettings) -> str:
    stopped = f"{run.longest_minutes} minutes it is stopped in place and can be resumed. "
    if stated.longest_minutes is None:
        return f"After {stopped}"
    longest = f"A run that lasts longer than {stated.longest_minutes:g} minutes"
    return f"{longest} goes back to its reference and ends; after {stopped}"


def _schedule_text(schedule: Schedule | None, *, is_removed: bool) -> str:
    """The units as they are, or what was removed, and how that is put in force."""
    if schedule is None:
        return "This cell has no schedule."
    if not is_removed:
        return "\n".join(f"{path}\n{read_text(path)}" for path in schedule.files).rstrip()
    control = _control(schedule)
    stop = f"  {control} stop {schedule.unit}.timer && {control} daemon-reload"
    return "\n".join([*(f"removed {path}" for path in schedule.files), "To put it in force:", stop])


def _control(schedule: Schedule) -> str:
    return "systemctl" if schedule.is_of_system else "systemctl --user"
