"""Text for the schedule of a cell: what was written, what it does, and how it is put in force."""

from __future__ import annotations

from hexacell.cell.operation import UnattendedSettings
from hexacell.services.schedule.scheduled_run import ScheduledRun
from hexacell.services.schedule.schedules import Schedule
from hexacell.text.layout import wrapped

MEANING = {
    "check": "It measures a few records and changes nothing.",
    "quick": "It corrects what has drifted since the last result; the config is changed only if every gate "
    "is passed.",
    "optimise": "It recalibrates; the config is changed only if every gate is passed.",
}


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
    return (
        f"A run that lasts longer than {stated.longest_minutes:g} minutes goes back to its reference and "
        f"ends; after {stopped}"
    )


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
