"""Text for the schedule of a cell: what was written, what it does, and how it is put in force."""

from __future__ import annotations

from hexacell.application.schedules import Schedule, ScheduleRequest
from hexacell.presentation.layout import wrapped

MEANING = {
    "check": "It measures a few records and changes nothing.",
    "quick": "It corrects what has drifted since the last result; the config is changed only if every gate "
    "is passed.",
    "optimise": "It recalibrates; the config is changed only if every gate is passed.",
}


def written_schedule_text(schedule: Schedule, request: ScheduleRequest) -> str:
    """What was written, in words, and how it is put in force."""
    again = (
        f"A device or lock that is not there is tried again {request.retries} times, every "
        f"{request.retry_minutes} minutes. "
        if request.retries
        else ""
    )
    explanation = (
        f"Each day at {request.daily} a {request.mode} begins. {MEANING[request.mode]} {again}After "
        f"{request.longest_minutes} minutes it is stopped in place and can be resumed. A day that the "
        "computer was off is made up for."
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
    return "\n".join([*lines, "To see how it went:", f"  {_log(schedule)}"])


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


def crontab_text(line: str) -> str:
    """The line, and where it belongs."""
    return f"Put this line into `crontab -e`; cron does not try again, and mails what is said:\n{line}"


def _control(schedule: Schedule) -> str:
    return "systemctl" if schedule.is_of_system else "systemctl --user"


def _log(schedule: Schedule) -> str:
    user = "" if schedule.is_of_system else "--user "
    return f"journalctl {user}-u {schedule.unit}"
