"""Runs without a person: quiet hours, retries, checks repeated after an alarm, the longest time."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from hexacell.cell.model import CellSettings
from hexacell.cell.operation import UnattendedSettings
from hexacell.errors import ExitCode, HexacellError, OutOfTime
from hexacell.runs import run_folder
from hexacell.services.run.calibration_run import RunRequest
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from procedures.engine.commands import CommandQueue, EndAtReference
from procedures.run.state import RunState

MAY_PASS = frozenset({ExitCode.HARDWARE, ExitCode.BUSY, ExitCode.OUT_OF_TIME})
"""Exit codes of refusals that may pass: device, stop line, full disk; the lock; quiet hours."""


def local_now() -> datetime:
    """The present moment in the computer's time zone."""
    return datetime.now(UTC).astimezone()


def refuse_quiet_hours(settings: CellSettings, at: datetime) -> None:
    """Refuse a run that would begin in quiet hours; raises ``OutOfTime``."""
    if (until := quiet_until(settings.unattended, at)) is not None:
        problem = f"these are quiet hours of the cell, until {until:%H:%M}: no run begins without a person"
        raise OutOfTime(problem, action="Let it begin later, or change quiet_hours in [unattended]")


def refused_start(request: RunRequest, error: HexacellError, began: datetime, at: datetime) -> float | None:
    """Note for the history that a run could not begin; gives seconds until the next try, if there is one.

    It was tried first when it ``began``. A disk that takes no note does not change what is reported.
    """
    _note_refusal(request.folder, request.mode.value, error, at)
    wanted = request.cell.settings.unattended
    again = at + timedelta(minutes=wanted.retry_minutes)
    is_open = again <= began + timedelta(minutes=wanted.window_minutes)
    return 60.0 * wanted.retry_minutes if is_open and error.exit_code in MAY_PASS else None


def note_unreadable_cell(path: Path, mode: str, error: HexacellError) -> None:
    """Note that a run could not begin, as the cell file at ``path`` has mistakes.

    Nothing is noted where the cell's name is unknown, or the disk takes no note.
    """
    if (folder := run_folder.runs_folder_of_unreadable(path)) is not None:
        _note_refusal(run_folder.new_run_in(folder), mode, error, datetime.now(UTC))


def _note_refusal(folder: run_folder.RunFolder, mode: str, error: HexacellError, at: datetime) -> None:
    attempt = run_folder.StartAttempt(
        at=at.astimezone(UTC), reason=str(error), exit_code=int(error.exit_code)
    )
    with suppress(HexacellError):
        run_folder.note_attempt(folder, mode, attempt)


def time_limit(settings: CellSettings, at: datetime) -> tuple[float, str] | None:
    """How many seconds a run that begins now may last, and why no longer; None where nothing limits it."""
    wanted, limits = settings.unattended, []
    if wanted.longest_minutes is not None:
        seconds = 60.0 * wanted.longest_minutes / settings.timing.clock_factor
        limits.append((seconds, f"it lasted longer than longest_minutes = {wanted.longest_minutes:g}"))
    if (quiet := next_quiet(wanted, at)) is not None:
        limits.append(((quiet - at).total_seconds(), f"quiet hours begin at {quiet:%H:%M}"))
    return min(limits, default=None)


@contextmanager
def ended_in_time(request: RunRequest, queue: CommandQueue) -> Iterator[None]:
    """Within this context, in a running loop, a run that keeps the cell's hours is ended in time."""
    limit = time_limit(request.cell.settings, local_now()) if request.keeps_hours else None
    if limit is None:
        yield
        return
    seconds, reason = limit
    timer = asyncio.get_running_loop().call_later(seconds, queue.put, EndAtReference(reason))
    try:
        yield
    finally:
        timer.cancel()


WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
DAYS_AHEAD = 8


def quiet_until(settings: UnattendedSettings, at: datetime) -> datetime | None:
    """When the quiet hours end in which a moment lies; None if it lies outside all.

    Where one ends as another begins, the end of the latter.
    """
    end: datetime | None = None
    for begin, until in sorted(_spans(settings, at)):
        if begin <= (end or at) < until:
            end = until
    return end


def next_quiet(settings: UnattendedSettings, at: datetime) -> datetime | None:
    """When quiet hours begin after a moment; the moment itself if it lies in some; None without any."""
    if quiet_until(settings, at) is not None:
        return at
    return min((begin for begin, _ in _spans(settings, at) if begin > at), default=None)


def _spans(settings: UnattendedSettings, at: datetime) -> Iterator[tuple[datetime, datetime]]:
    """Begin and end of all from the day before a moment to a week after it, in its time zone."""
    midnight = at.replace(hour=0, minute=0, second=0, microsecond=0)
    for number in range(-1, DAYS_AHEAD):
        day = midnight + timedelta(days=number)
        if WEEKDAYS[day.weekday()] in settings.quiet_days:
            for begin, length in settings.quiet_spans:
                start = day + timedelta(minutes=begin)
                yield start, start + timedelta(minutes=length)


def repetition(request: RunRequest, state: RunState) -> RunRequest | None:
    """The check to be made once more after one that nobody watched; None where there is no need.

    One that failed is not repeated: it has found what an alarm only suspects.
    """
    is_check = request.unattended and request.mode is Mode.CHECK
    if not is_check or state.alarm is None or state.verdict is Verdict.FAIL:
        return None
    return replace(request, folder=run_folder.new_run(request.cell), resume=False)
