"""What a scheduler is to start, and when: as units of systemd, or as a line of a crontab.

The service runs once, and a timer starts it. Sources: systemd.service(5), systemd.exec(5),
systemd.timer(5), systemd.syntax(7), crontab(5).
"""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hexacell.errors import ExitCode, UsageError

_TIME = re.compile(r"([01][0-9]|2[0-3]):([0-5][0-9])")
MOST_MINUTES = 24 * 60


@dataclass(frozen=True, slots=True)
class ScheduledRun:
    """A run of a cell that begins at the same time each day.

    Attributes:
        cell: the cell file, absolute.
        name: of the cell.
        program: the words that start hexacell, absolute.
        mode: ``check``, ``quick`` or ``optimise``.
        hour, minute: when it begins, in the computer's time zone.
        longest_minutes: after so long it is ended in place, and can be resumed.
        retry_minutes: so long after a failure that may pass (a device, the lock) it is tried again.
        retries: how often.
        writable: the folders that it writes into: of the cell, of the controller's config, of metrics.
        metrics: the file that they are written to after each run, if any.
        on_failure: the unit that systemd starts after a failure, if any.
    """

    cell: Path
    name: str
    program: tuple[str, ...]
    mode: str
    hour: int
    minute: int
    longest_minutes: int
    retry_minutes: int
    retries: int
    writable: tuple[Path, ...]
    metrics: Path | None = None
    on_failure: str | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The command and its arguments."""
        return (*self.program, "run", str(self.cell), "--unattended", "--mode", self.mode)

    @property
    def words_afterwards(self) -> tuple[str, ...]:
        """The command that writes the metrics; empty without."""
        if self.metrics is None:
            return ()
        return (*self.program, "status", str(self.cell), "--metrics", str(self.metrics))

    @property
    def unit(self) -> str:
        """The name of its units, without their kind."""
        plain = re.sub(r"[^A-Za-z0-9]+", "-", self.name).strip("-").lower()
        return f"hexacell-{plain or 'cell'}"


def time_of_day(text: str) -> tuple[int, int]:
    """Hour and minute.

    Raises:
        UsageError: it is no time of day.
    """
    found = _TIME.fullmatch(text)
    if found is None:
        raise UsageError(f"'{text}' is no time of day", action="Write it as 02:30")
    return int(found[1]), int(found[2])


def crontab_line(run: ScheduledRun) -> str:
    """The line. Cron takes % for a line's end, has no retries, and mails what is printed."""
    longest = ("timeout", "--signal=TERM", "--kill-after=120", f"{run.longest_minutes}m")
    begun = f"cd {shlex.quote(str(run.cell.parent))} && {shlex.join([*longest, *run.words])} </dev/null"
    command = f"{begun}; {shlex.join(run.words_afterwards)}" if run.metrics else begun
    escaped = command.replace("%", "\\%")
    return f"{run.minute} {run.hour} * * * {escaped}"


MARK = "# Written by `hexacell schedule` for "
"""The first line of a unit, before the path of its cell file: no other file is replaced or removed."""

STOPPING_S = 120
"""So long a run may take to stop the robot and to keep its journal before it is killed."""

WORTH_ANOTHER_TRY = (ExitCode.HARDWARE, ExitCode.BUSY)

HARDENING = (
    "NoNewPrivileges=yes",
    "CapabilityBoundingSet=",
    "ProtectSystem=strict",
    "ProtectHome=read-only",
    "ProtectClock=no",
    "ProtectKernelTunables=yes",
    "ProtectKernelModules=yes",
    "ProtectKernelLogs=yes",
    "ProtectControlGroups=yes",
    "RestrictNamespaces=yes",
    "RestrictRealtime=yes",
    "RestrictSUIDSGID=yes",
    "LockPersonality=yes",
    "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_CAN",
    "SystemCallArchitectures=native",
    "UMask=0077",
)
"""Settings of a system's service. ProtectClock would take the serial lines away; the families are those of
controllers and CAN."""


TEMPORARY = (Path("/tmp"), Path("/var/tmp"))  # noqa: S108 - what PrivateTmp hides


def service_text(run: ScheduledRun, user: str | None, groups: Sequence[str]) -> str:
    """The service; of the system for a ``user`` with some ``groups``, else of the user who enables it."""
    unit = ["[Unit]", f"Description=hexacell: {_plain(run.mode)} of {_plain(run.name)}"]
    unit += [f"OnFailure={run.on_failure}"] if run.on_failure else []
    unit += [f"StartLimitIntervalSec={(run.retries + 1) * (run.longest_minutes + run.retry_minutes)}min"]
    unit += [f"StartLimitBurst={run.retries + 1}"]
    service = [
        "[Service]",
        "Type=oneshot",
        f"ExecStart={_command(run.words)}",
        *([f"ExecStopPost={_command(run.words_afterwards)}"] if run.metrics else []),
        f"WorkingDirectory={_plain(str(run.cell.parent))}",
        f"TimeoutStartSec={run.longest_minutes}min",
        f"TimeoutStopSec={STOPPING_S}",
        "KillSignal=SIGTERM",
        "StandardInput=null",
    ]
    if run.retries:  # only after failures that may pass by themselves, not after a verdict
        others = [code for code in ExitCode if code not in {*WORTH_ANOTHER_TRY, ExitCode.DONE}]
        final = " ".join(str(int(code)) for code in others)
        service += ["Restart=on-failure", f"RestartSec={run.retry_minutes}min"]
        service += [f"RestartPreventExitStatus={final} SIGTERM"]
    if user is not None:
        service += [f"User={_plain(user)}"]
        service += [f"SupplementaryGroups={' '.join(groups)}"] if groups else []
        # A cell below a temporary folder is seen only in the folder that all share.
        is_temporary = any(one.is_relative_to(folder) for one in run.writable for folder in TEMPORARY)
        service += [*HARDENING, "PrivateTmp=no" if is_temporary else "PrivateTmp=yes"]
        service += [f"ReadWritePaths={_quoted(str(one))}" for one in run.writable]
    return _file(run, [*unit, "", *service])


def timer_text(run: ScheduledRun) -> str:
    """The timer. A night that the computer slept through is made up for once it runs."""
    return _file(
        run,
        [
            "[Unit]",
            f"Description=hexacell: daily {_plain(run.mode)} of {_plain(run.name)}",
            "",
            "[Timer]",
            f"OnCalendar=*-*-* {run.hour:02}:{run.minute:02}:00",
            "Persistent=yes",
            "AccuracySec=1min",
            "",
            "[Install]",
            "WantedBy=timers.target",
        ],
    )


def cell_of(unit_text: str) -> Path | None:
    """The cell file that a unit was written for; None if `hexacell schedule` did not write it."""
    first = unit_text.split("\n", 1)[0]
    return Path(first.removeprefix(MARK)) if first.startswith(MARK) else None


def _file(run: ScheduledRun, lines: Sequence[str]) -> str:
    return "\n".join([f"{MARK}{run.cell}", *lines]) + "\n"


def _plain(text: str) -> str:
    """A value of one line; only % has a meaning there."""
    return text.replace("%", "%%")


def _command(words: Sequence[str]) -> str:
    """A command line: each argument quoted, with nothing in it replaced."""
    return " ".join(_quoted(word).replace("$", "$$") for word in words)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{_plain(escaped)}"'
