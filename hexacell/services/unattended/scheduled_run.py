"""What a scheduler is to start, and when, as units of systemd.

The service runs once, and a timer starts it. Sources: systemd.service(5), systemd.exec(5),
systemd.timer(5), systemd.syntax(7).
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import ClassVar
from zoneinfo import ZoneInfo

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from hexacell.errors import ExitCode, UsageError

_TIME = re.compile(r"([01][0-9]|2[0-3]):([0-5][0-9])")
STOPPING_S = 120
"""So long a run may take to stop the robot and to keep its journal before it is killed."""


@dataclass(frozen=True, slots=True)
class ScheduledRun:
    """A run of a cell that begins at the same time each day.

    Attributes:
        cell: the cell file, absolute.
        program: the words that start hexacell, absolute.
        mode: ``check``, ``quick`` or ``optimise``.
        hour, minute: when it begins, in the computer's time zone.
        longest_minutes: after so long it is ended in place, and can be resumed.
        retries: how often it is tried again, each time after ``retry_minutes``, when a failure may pass (a
            device, the lock).
        writable: the folders that it writes into: of the cell, of the controller's config, of metrics.
        metrics: the file that they are written to after each run, if any.
    """

    cell: Path
    name: str
    program: tuple[str, ...]
    mode: str
    hour: int
    minute: int
    longest_minutes: int
    retries: int
    retry_minutes: ClassVar[int] = 15
    writable: tuple[Path, ...]
    metrics: Path | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The command and its arguments."""
        return (*self.program, "run", str(self.cell), "--unattended", "--mode", self.mode)

    @property
    def words_afterwards(self) -> tuple[str, ...]:
        """The command that writes the metrics."""
        return (*self.program, "status", str(self.cell), "--metrics", str(self.metrics))

    @property
    def unit(self) -> str:
        """The name of its units, without their kind."""
        plain = re.sub(r"[^A-Za-z0-9]+", "-", self.name).strip("-").lower()
        return f"hexacell-{plain or 'cell'}"


def time_of_day(text: str) -> tuple[int, int]:
    """Hour and minute; raises ``UsageError``."""
    if (found := _TIME.fullmatch(text)) is None:
        raise UsageError(f"'{text}' is no time of day", action="Write it as 02:30")
    return int(found[1]), int(found[2])


MARK = "# Written by `hexacell schedule` for "
"""The first line of a unit, before the path of its cell file: no other file is replaced or removed."""

WORTH_ANOTHER_TRY = (ExitCode.HARDWARE, ExitCode.BUSY)

TEMPORARY = (Path("/tmp"), Path("/var/tmp"))  # noqa: S108 - what PrivateTmp hides


LOCAL_TIME = Path("/etc/localtime")  # as for systemd; UTC without


def skipped_day(hour: int, minute: int, today: date) -> date | None:
    """The first day within a year on which clocks go forward past a time of day in the computer's zone.

    systemd then begins nothing; where a time is there twice it begins once (as ``systemd-analyze`` tells).
    """
    with suppress(OSError, ValueError), LOCAL_TIME.open("rb") as file:
        zone = ZoneInfo.from_file(file)
        for day in (today + timedelta(days) for days in range(366)):
            at = datetime.combine(day, time(hour, minute), zone)
            if at.timestamp() > at.replace(fold=1).timestamp():
                return day
    return None


def service_text(run: ScheduledRun, user: str | None, groups: Sequence[str]) -> str:
    """The service; of the system for a ``user`` with some ``groups``, else of the user who enables it."""
    return _unit(
        "run.service.j2",
        run,
        user=user,
        groups=groups,
        final=[int(code) for code in ExitCode if code not in {*WORTH_ANOTHER_TRY, ExitCode.DONE}],
        # A cell below a temporary folder is seen only in the folder that all share.
        is_temporary=any(one.is_relative_to(folder) for one in run.writable for folder in TEMPORARY),
    )


def timer_text(run: ScheduledRun) -> str:
    """The timer."""
    return _unit("run.timer.j2", run)


def _unit(template: str, run: ScheduledRun, **values: object) -> str:
    environment = Environment(  # noqa: S701 - units are no HTML
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"plain": _plain, "quoted": _quoted, "command": _command}
    return environment.get_template(template).render(mark=MARK, run=run, stopping_s=STOPPING_S, **values)


def _plain(text: object) -> str:
    """A value of one line; only % has a meaning there."""
    return str(text).replace("%", "%%")


def _command(words: Sequence[str]) -> str:
    """A command line: each argument quoted, with nothing in it replaced."""
    return " ".join(_quoted(word).replace("$", "$$") for word in words)


def _quoted(text: object) -> str:
    escaped = str(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{_plain(escaped)}"'
