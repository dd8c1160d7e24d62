"""The journal: events are read back as they were appended; there is one writer at a time."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import time
import zlib
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexacell.errors import CellBusy, FileError
from procedures.journal import journal as line_format
from procedures.journal.journal import Journal, read_entries, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.identified import an_identification
from tests.procedures.journal.told import TOLD, write_told
from tests.procedures.story import READING


def test_appended_events_are_read_back(path: Path, written: bytes) -> None:
    assert read_journal(path) == TOLD
    with Journal(path) as journal:
        assert journal.events == TOLD
    assert path.read_bytes() == written


def test_a_reopened_journal_is_continued(path: Path, written: bytes) -> None:
    with Journal(path) as journal:
        journal.append(events.RolledBack())
        assert journal.events == (*TOLD, events.RolledBack())
    assert read_journal(path) == (*TOLD, events.RolledBack())
    assert path.read_bytes().startswith(written)


def test_a_line_is_an_event_with_number_time_and_checksum(written: bytes) -> None:
    lines = written.split(b"\n")
    assert lines.pop() == b""
    assert len(lines) == len(TOLD)
    for number, line in enumerate(lines, 1):
        record = json.loads(line)
        checksum = record.pop("crc")
        compact = json.dumps(record, separators=(",", ":"), ensure_ascii=False).encode()
        assert record["n"] == number
        assert record["at"].endswith("Z")
        assert int(checksum, 16) == zlib.crc32(compact)


@pytest.fixture
def synced(monkeypatch) -> list[tuple[str, int]]:
    """What is forced to the disk: the name of each file or folder, and its size then."""
    found: list[tuple[str, int]] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        name = Path(f"/proc/self/fd/{descriptor}").readlink()
        found.append((str(name), os.fstat(descriptor).st_size))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    return found


def test_every_event_is_forced_to_the_disk_before_append_returns(path: Path, synced) -> None:
    with Journal(path) as journal:
        synced.clear()
        for event in TOLD:
            journal.append(event)
            assert synced[-1] == (str(path), path.stat().st_size)
    assert len(synced) == len(TOLD)


def test_the_journals_name_is_forced_to_the_disk_too(path: Path, synced) -> None:
    with Journal(path):
        assert str(path.parent) in [name for name, _ in synced]


def test_a_journal_that_is_absent_cannot_be_read(path: Path) -> None:
    with pytest.raises(FileError, match="does not exist"):
        read_journal(path)


def test_a_journal_in_no_folder_cannot_be_opened(path: Path) -> None:
    with pytest.raises(FileError, match="cannot be opened"):
        Journal(path / "nowhere")


def test_one_writer_at_a_time(path: Path) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with pytest.raises(CellBusy, match="another process"):
            Journal(path)
        assert read_journal(path) == TOLD[:1]
        journal.append(TOLD[1])
    with Journal(path) as journal:
        assert journal.events == TOLD[:2]


numbers = st.floats()
texts = st.text(st.characters(exclude_categories=["Cs"]))


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    text=texts,
    values=st.tuples(numbers, numbers, numbers),
    results=st.lists(numbers, max_size=3).map(tuple),
)
def test_every_number_and_every_text_is_read_back_exactly(path: Path, text, values, results) -> None:
    key = SetKey(phase=Phase.IDENTIFY, point=1)
    told = (
        events.SetClosed(at=key, drift_mm=values, reading=READING),
        events.SetInvalidated(at=key, reason=text),
        events.Identified(result=an_identification(covariance=(results,), frame=text), held_out=()),
    )
    path.unlink(missing_ok=True)
    with Journal(path) as journal:
        for event in told:
            journal.append(event)
    assert list(map(repr, read_journal(path))) == list(map(repr, told))


def test_a_pipe_in_place_of_the_journal_is_refused_without_blocking(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(FileError, match="not a file"):
        read_journal(path)
    with pytest.raises(FileError, match="not a file"):
        Journal(path)


def test_a_file_system_without_locks_is_reported(path: Path, monkeypatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(FileError, match="cannot be opened"):
        Journal(path)


def test_a_wall_clock_that_jumps_leaves_the_monotonic_times_sorted(path: Path, monkeypatch) -> None:
    """The wall clock is set back and forth; the monotonic clock is not affected."""
    hours = iter([0, 5, -30_000, 2])
    begun = time.monotonic() - 0.001
    real = datetime.now

    class Clock:
        @staticmethod
        def now(zone: Any) -> datetime:
            return real(zone) + timedelta(hours=next(hours))

    monkeypatch.setattr(line_format, "datetime", Clock)
    write_told(path)
    monkeypatch.undo()
    entries = read_entries(path)
    assert tuple(entry.event for entry in entries) == TOLD
    assert [entry.at.utcoffset() for entry in entries] == [timedelta(0)] * len(TOLD)
    assert entries[2].at < entries[0].at < entries[1].at
    seconds = [entry.monotonic_s for entry in entries]
    assert len(seconds) == len(TOLD)
    assert seconds == sorted(seconds)
    assert begun <= seconds[0] <= seconds[-1] <= time.monotonic() + 0.001
