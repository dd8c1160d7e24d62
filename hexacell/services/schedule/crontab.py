"""A scheduled run as a line of a crontab, where there is no systemd; source: crontab(5)."""

from __future__ import annotations

import shlex

from hexacell.services.schedule.scheduled_run import ScheduledRun


def crontab_line(run: ScheduledRun) -> str:
    """The line. Cron takes % for a line's end, has no retries, and mails what is printed."""
    longest = ("timeout", "--signal=TERM", "--kill-after=120", f"{run.longest_minutes}m")
    begun = f"cd {shlex.quote(str(run.cell.parent))} && {shlex.join([*longest, *run.words])} </dev/null"
    command = f"{begun}; {shlex.join(run.words_afterwards)}" if run.metrics else begun
    escaped = command.replace("%", "\\%")
    return f"{run.minute} {run.hour} * * * {escaped}"
