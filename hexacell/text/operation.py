"""Text for what happens without anybody there: notices sent and waiting, and the schedule of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hexacell.cell.operation import NotificationSettings, UnattendedSettings, scheme_of
from hexacell.text.layout import wrapped

if TYPE_CHECKING:
    from hexacell.services.unattended.notice import PendingNotice
    from hexacell.services.unattended.outbox import NotifyOutcome
    from hexacell.services.unattended.scheduled_run import ScheduledRun
    from hexacell.services.unattended.schedules import Schedule

NOBODY = "nobody is notified; write [[notifications]] in the cell file"
NEXT_TIME = "sent at the next run, or by hexacell notify CELL --send"
MEANING = {
    "check": "It measures a few records and changes nothing.",
    "quick": "It corrects what has drifted since the last result; the config is changed only if every gate "
    "is passed.",
    "optimise": "It recalibrates; the config is changed only if every gate is passed.",
}
"""What a scheduled run of each mode does."""


def notify_line(outcome: NotifyOutcome) -> str | None:
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


def notify_text(outcome: NotifyOutcome) -> str:
    """A line for each recipient: how many notices it took, or why not."""
    lines = [f"{one.name}: {one.problem or f'notified ({one.sent})'}" for one in outcome.deliveries]
    return "\n".join([*lines, *_dropped(outcome)] or ["nothing waits"])


def _dropped(outcome: NotifyOutcome) -> list[str]:
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
    """What is tried again where the run cannot begin."""
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
    """How it ends when it lasts too long."""
    stopped = f"{run.longest_minutes} minutes it is stopped in place and can be resumed. "
    if stated.longest_minutes is None:
        return f"After {stopped}"
    longest = f"A run that lasts longer than {stated.longest_minutes:g} minutes"
    return f"{longest} goes back to its reference and ends; after {stopped}"


def present_schedule_text(schedule: Schedule | None) -> str:
    """The units as they are."""
    if schedule is None:
        return "This cell has no schedule."
    return "\n".join(f"{path}\n{path.read_text()}" for path in schedule.files).rstrip()


def removed_schedule_text(schedule: Schedule | None) -> str:
    """What was removed, and how that is put in force."""
    if schedule is None:
        return "This cell has no schedule."
    control = _control(schedule)
    stop = f"  {control} stop {schedule.unit}.timer && {control} daemon-reload"
    return "\n".join([*(f"removed {path}" for path in schedule.files), "To put it in force:", stop])


def crontab_text(line: str, stated: UnattendedSettings) -> str:
    """The line, and where it belongs."""
    tries = "the run tries again in its window" if stated.window_minutes else "cron does not try again"
    return f"Put this line into `crontab -e`; {tries}, and cron mails what is said:\n{line}"


def _control(schedule: Schedule) -> str:
    return "systemctl" if schedule.is_of_system else "systemctl --user"
