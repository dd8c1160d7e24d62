"""Runs without a person: in quiet hours, refused and tried again, and ended at their reference in time."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from hexacell import errors
from hexacell.cell.operation import UnattendedSettings
from hexacell.measurements.csv_file import read_measurements
from hexacell.runs.run_folder import RunFolder, find_run, read_attempts, runs_folder
from hexacell.services.history.past_runs import past_runs, reason_to_keep
from hexacell.services.run.calibration_run import RunRequest, calibrate
from hexacell.services.unattended.unattended_runs import (
    ended_in_time,
    refuse_quiet_hours,
    refused_start,
    time_limit,
)
from procedures.engine.commands import CommandQueue, EndAtReference
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from tests.hexacell.services.conftest import order_of

NIGHT = datetime(2026, 3, 3, 2, 30, tzinfo=UTC)
UNPLUGGED = errors.DeviceError("does not answer", subject="gauge y")


def settings_with(cell: Any, **unattended: Any) -> Any:
    stated = UnattendedSettings.model_validate(unattended)
    return cell.settings.model_copy(update={"unattended": stated})


@dataclass(frozen=True)
class Refusing:
    """Refuses the run of a night, so many minutes after it was tried first."""

    request: RunRequest

    def __call__(self, error: errors.HexacellError = UNPLUGGED, minutes: float = 0.0) -> float | None:
        return refused_start(self.request, error, NIGHT, NIGHT + timedelta(minutes=minutes))


@pytest.fixture
def refused(make_cell) -> Refusing:
    cell = make_cell(unattended=UnattendedSettings(window_minutes=60.0, retry_minutes=20.0))
    return Refusing(order_of(cell, RunFolder(runs_folder(cell) / "night"), keeps_hours=True))


def test_a_night_that_was_refused_is_in_the_history_with_its_reason(refused) -> None:
    for minutes in (0, 20):
        refused(minutes=minutes)
    [night] = past_runs(refused.request.cell)
    assert (night.name, night.summary.mode, night.summary.has_begun) == ("night", "optimise", False)
    assert night.summary.line == "not begun (2 tries): gauge y: does not answer"
    assert night.summary.ended == NIGHT + timedelta(minutes=20)
    assert night.summary.verdict is None
    assert reason_to_keep(night) is None  # it may be deleted like any other


def test_what_may_pass_is_tried_again_while_its_window_is_open(refused) -> None:
    assert [refused(minutes=minutes) for minutes in (0, 40, 41)] == [1200.0, 1200.0, None]
    for error in (UNPLUGGED, errors.CellBusy("in use"), errors.OutOfTime("quiet hours")):
        assert refused(error) is not None
    for mistake in (errors.UsageError("no accepted result"), errors.FileError("cannot be read")):
        assert refused(mistake) is None


def test_a_disk_that_takes_no_note_changes_nothing_else(refused, monkeypatch) -> None:
    def full(*_: object) -> None:
        raise errors.FileError("no space left on device")

    monkeypatch.setattr("hexacell.runs.run_folder.note_attempt", full)
    assert refused() == 1200.0


def test_a_refused_night_is_no_run_to_resume_and_a_damaged_note_is_named(refused) -> None:
    refused()
    with pytest.raises(errors.UsageError, match="the run 'night' never began"):
        find_run(refused.request.cell, "night")
    folder = refused.request.folder
    folder.attempts.write_text("{}")
    with pytest.raises(errors.FileError, match=r"not-begun\.json"):
        read_attempts(folder)
    [night] = past_runs(refused.request.cell)
    assert "not-begun.json" in night.summary.line


def test_quiet_hours_say_when_they_end(make_cell) -> None:
    settings = settings_with(make_cell(), quiet_hours=("02:00-04:00",))
    with pytest.raises(errors.OutOfTime, match="quiet hours of the cell, until 04:00") as refusal:
        refuse_quiet_hours(settings, NIGHT)
    assert refusal.value.exit_code == errors.ExitCode.OUT_OF_TIME
    refuse_quiet_hours(settings, NIGHT + timedelta(hours=2))


def test_whatever_comes_first_ends_a_run(make_cell) -> None:
    cell = make_cell(timing__clock_factor=1.0)
    assert time_limit(cell.settings, NIGHT) is None
    both = {"longest_minutes": 90.0, "quiet_hours": ("05:30-22:00",)}
    assert time_limit(settings_with(cell, **both), NIGHT) == (
        5400.0,
        "it lasted longer than longest_minutes = 90",
    )
    late = NIGHT + timedelta(hours=2)
    assert time_limit(settings_with(cell, **both), late) == (3600.0, "quiet hours begin at 05:30")


async def test_the_run_is_told_when_its_time_is_over(make_cell) -> None:
    cell = make_cell(unattended=UnattendedSettings(longest_minutes=0.01))
    queue = CommandQueue()
    request = order_of(cell, RunFolder(runs_folder(cell) / "night"), keeps_hours=True)
    with queue.attended(), ended_in_time(request, queue):
        command = await queue.next()
    assert isinstance(command, EndAtReference)
    assert "longest_minutes = 0.01" in command.reason
    with ended_in_time(replace(request, keeps_hours=False), queue):
        pass  # nobody's hours
    assert list(queue.take()) == []


async def test_it_ends_at_its_reference_and_can_be_resumed(make_site, finished) -> None:
    """With the same records and the same config, byte for byte, as a run that had the time."""
    site, queue, counted = make_site(), CommandQueue(), 0
    site.write(finished.until(events.RecordTaken, count=18), finished)

    def count(event: events.Event, _: object) -> None:
        nonlocal counted
        counted += isinstance(event, events.RecordTaken)
        if counted == 2:
            queue.put(EndAtReference("it lasted longer than longest_minutes = 1"))

    before = site.config
    with pytest.raises(
        errors.OutOfTime, match="the run was ended: it lasted longer than longest_minutes = 1"
    ):
        await calibrate(site.order(resume=True), [count], queue)
    state = fold(read_journal(site.folder.journal))
    assert state.at_pose is None or state.at_pose[1] == 1
    assert site.happened(events.Arrived)[-1].orientation == 1
    interrupted = site.happened(events.Interrupted)[-1]
    assert interrupted.exit_code == errors.ExitCode.OUT_OF_TIME
    assert site.config == before
    ended = await site.calibrate(resume=True)
    assert ended.exit_code == errors.ExitCode.DONE
    assert len(read_measurements(site.folder.measurements)) == 24


async def test_after_the_write_back_an_unverified_geometry_does_not_stay(make_site, finished) -> None:
    site, queue = make_site(), CommandQueue()
    before = site.config
    site.write(finished.until(events.Proposed), finished)

    def end(event: events.Event, _: object) -> None:
        if isinstance(event, events.RecordTaken) and event.at.phase is Phase.AFTER:
            queue.put(EndAtReference("quiet hours begin at 05:30"))

    with pytest.raises(
        errors.WriteBackUndone, match=r"the old config is back\. the run was ended"
    ) as refusal:
        await calibrate(site.order(resume=True), [end], queue)
    assert refusal.value.exit_code == errors.ExitCode.WRITE_BACK_UNDONE
    assert site.config == before
