"""The schedule of a cell: units of systemd written, shown and removed; nothing else is touched."""

import grp
import os
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.cell.operation import DAY_MINUTES
from hexacell.errors import FileError, UsageError
from hexacell.python_process import python_command
from hexacell.services.unattended.scheduled_run import (
    MARK,
    ScheduledRun,
    service_text,
    time_of_day,
    timer_text,
)
from hexacell.storage import atomic_files
from hexacell.storage.output_files import UNIT, OutputFile

SYSTEM_UNITS = Path("/etc/systemd/system")
USER_UNITS = Path(".config/systemd/user")
DEVICE_GROUPS = ("dialout",)
"""Who may open serial lines, on Debian and its like; named where it exists."""

VERIFYING_S = 20.0
LONGEST_MINUTES = 120.0
"""Longest duration of a run that states no longer one itself."""

SPARE_MINUTES = 10.0
"""Beside its longest duration, for a run to go back to its reference."""

MOST_RETRIES = 3


@dataclass(frozen=True, slots=True)
class Schedule:
    """The units of one cell, and what systemd says is wrong with them.

    ``is_of_system`` is whether they run without a user being logged in.
    """

    unit: str
    files: tuple[Path, ...]
    is_of_system: bool
    complaints: tuple[str, ...] = ()


def scheduled_run(cell: Cell, daily: str, mode: str, metrics: Path | None) -> ScheduledRun:
    """What is to be started, each day at the time ``daily``; raises ``UsageError``.

    What the cell file says of window and longest duration the run itself keeps: a service must leave it the
    time for that, and does not try again what was tried for a whole window.
    """
    hour, minute = time_of_day(daily)
    stated = cell.settings.unattended
    own_minutes = 0.0 if stated.longest_minutes is None else stated.longest_minutes + SPARE_MINUTES
    longest_minutes = ceil(stated.window_minutes + max(LONGEST_MINUTES, own_minutes))
    tries = DAY_MINUTES // (longest_minutes + ScheduledRun.retry_minutes)
    if not tries:
        raise UsageError(
            "it may last longer than a day",
            subject=cell.path,
            action="Lower window_minutes or longest_minutes in [unattended]",
        )
    path, metrics = cell.path.resolve(), metrics and metrics.resolve()
    folders = (path.parent, *(config.resolve().parent for config in cell.config_paths))
    run = ScheduledRun(
        cell=path,
        name=cell.settings.name,
        program=python_command("hexacell"),
        mode=mode,
        hour=hour,
        minute=minute,
        longest_minutes=longest_minutes,
        retries=0 if stated.window_minutes else min(MOST_RETRIES, tries - 1),
        writable=tuple(dict.fromkeys((*folders, *([] if metrics is None else [metrics.parent])))),
        metrics=metrics,
    )
    _require_possible(cell, run)
    return run


def write_schedule(run: ScheduledRun, folder: Path | None) -> Schedule:
    """Write the units, into a folder or where this user's units are.

    Those that the cell had under an earlier name are removed: a cell has one schedule. Raises
    ``UsageError`` if another cell's units have this name, or ``FileError``.
    """
    place, is_of_system = _place(folder)
    service, timer = place / f"{run.unit}.service", place / f"{run.unit}.timer"
    for path in (service, timer):
        _require_ours(path, run.cell)
    user = _owner_of(run.cell) if is_of_system else None
    groups: list[str] = []
    for group in DEVICE_GROUPS:
        with suppress(KeyError):
            groups.append(grp.getgrnam(group).gr_name)
    atomic_files.create_folder_durably(place)
    _remove_units([path for path in _units_of(run.cell, place) if path not in {service, timer}])
    atomic_files.write_own(service, service_text(run, user, groups).encode())
    atomic_files.write_own(timer, timer_text(run).encode())
    return Schedule(run.unit, (service, timer), is_of_system, _verified((service, timer)))


def present_schedule(cell: Cell, folder: Path | None) -> Schedule | None:
    """The units of a cell; None if it has no schedule."""
    place, is_of_system = _place(folder)
    found = _units_of(cell.path.resolve(), place)
    return Schedule(found[0].stem, found, is_of_system) if found else None


def remove_schedule(cell: Cell, folder: Path | None) -> Schedule | None:
    """Remove the units of a cell, and that they begin with the computer; gives what there was.

    Raises:
        FileError: they cannot be removed.
    """
    if (present := present_schedule(cell, folder)) is not None:
        _remove_units(present.files)
    return present


def _units_of(cell: Path, place: Path) -> tuple[Path, ...]:
    return tuple(path for path in sorted(place.glob("hexacell-*.*")) if _cell_of(path) == cell)


def _remove_units(files: Sequence[Path]) -> None:
    enabled = [path.parent / "timers.target.wants" / path.name for path in files]
    for path in (*enabled, *files):
        with atomic_files.os_errors("cannot be removed", path):
            path.unlink(missing_ok=True)


def _require_possible(cell: Cell, run: ScheduledRun) -> None:
    settings = cell.settings
    if settings.stations.placement == "by-hand":
        raise UsageError(
            "unattended running is not possible: the gauges are put at each point by hand",
            subject=cell.path,
            action='Fix gauges at every point and write placement = "fixed" in [stations]',
        )
    if not str(run.cell).isprintable():
        problem = "a path with control characters cannot be scheduled"
        raise UsageError(problem, subject=cell.path, action="Rename the folder")
    if run.metrics is not None and not run.metrics.parent.is_dir():
        raise UsageError("the folder of the metrics does not exist", subject=run.metrics, action="Make it")

    at = 60 * run.hour + run.minute
    for begin, length in settings.unattended.quiet_spans:
        if (at - begin) % DAY_MINUTES < length:
            raise UsageError(
                f"{run.hour:02}:{run.minute:02} is in the quiet hours of the cell",
                subject=cell.path,
                action="Choose another time, or change quiet_hours in [unattended]",
            )


def _place(folder: Path | None) -> tuple[Path, bool]:
    is_of_system = os.geteuid() == 0
    if folder is not None:
        return folder, is_of_system
    return (SYSTEM_UNITS if is_of_system else Path.home() / USER_UNITS), is_of_system


def _cell_of(path: Path) -> Path | None:
    """The cell file that a unit was written for; None if `hexacell schedule` did not write it."""
    try:
        first = atomic_files.read_text(path).split("\n", 1)[0]
    except FileError:
        return None
    return Path(first.removeprefix(MARK)) if first.startswith(MARK) else None


def _require_ours(path: Path, cell: Path) -> None:
    OutputFile(path, UNIT).require()
    if path.exists() and (other := _cell_of(path)) != cell:
        problem = f"this is the schedule of {other or 'another cell'}"
        raise UsageError(problem, subject=path, action="Give one of the cells another name")


def _owner_of(cell: Path) -> str:
    """Whoever owns the cell file runs it: not root, where root only writes the units."""
    try:
        return cell.owner()
    except (OSError, KeyError) as error:
        raise UsageError(
            "nobody on this computer owns it", subject=cell, action="Give it an owner"
        ) from error


def _verified(units: Sequence[Path]) -> tuple[str, ...]:
    if (program := shutil.which("systemd-analyze")) is None:
        return ()
    try:
        done = subprocess.run(  # noqa: S603 - our own files
            [program, "verify", *map(str, units)],
            capture_output=True,
            text=True,
            timeout=VERIFYING_S,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ()
    names = [path.name for path in units]
    return tuple(line for line in done.stderr.splitlines() if any(name in line for name in names))
