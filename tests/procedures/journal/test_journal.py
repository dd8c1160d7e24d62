"""The journal: events are read back as they were appended, by one writer, whatever the disk does."""

import errno
import fcntl
import json
import os
import time
import zlib
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexacell.errors import CellBusy, FileError
from procedures.journal import journal as line_format
from procedures.journal.journal import Journal, read_entries, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.journal.conftest import TOLD, write_told
from tests.procedures.story import READING, an_identification


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
        assert str(path.parent) in [name for name, _ in synced], "so is the journal's name"
        synced.clear()
        for event in TOLD:
            journal.append(event)
            assert synced[-1] == (str(path), path.stat().st_size)
    assert len(synced) == len(TOLD)


def test_a_journal_that_is_absent_or_in_no_folder_is_told(path: Path) -> None:
    with pytest.raises(FileError, match="does not exist"):
        read_journal(path)
    with pytest.raises(FileError, match="cannot be opened"):
        Journal(path / "nowhere")


def test_a_journal_is_read_while_another_process_appends_to_it(path, written, monkeypatch) -> None:
    """Half a line when it was opened, the whole of it an instant later: not damaged."""
    half = len(written) - 20
    path.write_bytes(written[:half])
    before = len(written.splitlines()) - 1
    decode = line_format.decode

    def appended_to(line: bytes, *others: Any) -> Any:
        if not line.endswith(b"\n"):
            path.write_bytes(written)
        return decode(line, *others)

    monkeypatch.setattr(line_format, "decode", appended_to)
    assert len(read_journal(path)) == before
    assert len(read_journal(path)) == before + 1


def test_one_writer_at_a_time(path: Path) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with pytest.raises(CellBusy, match="another process"):
            Journal(path)
        assert read_journal(path) == TOLD[:1]
        journal.append(TOLD[1])
    with Journal(path) as journal:
        assert journal.events == TOLD[:2]


@pytest.mark.parametrize(("hours", "lasted_s"), [(1, 3800.0), (-1, 200.0)])
def test_the_time_of_a_run_goes_on_while_it_is_interrupted(path, monkeypatch, hours, lasted_s) -> None:
    """From its last reading by the wall clock, which may have been set back."""
    reading, ago = READING.model_copy(update={"at_s": 200.0}), timedelta(hours=hours)
    monkeypatch.setattr(line_format, "now", lambda: (datetime.now(UTC) - ago, 0.0))
    with Journal(path) as journal:
        assert journal.lasted_s == 0.0
        journal.append(events.ReferenceRepeated(at=SetKey(phase=Phase.IDENTIFY, point=1), reading=reading))
        journal.append(events.Paused(at_once=False))
    with Journal(path) as journal:
        assert journal.lasted_s == pytest.approx(lasted_s, abs=60.0)


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
    monkeypatch.setattr(fcntl, "flock", Mock(side_effect=OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))))
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


class FullDisk:
    """A disk with room for some more bytes; its faults come from the calls they would come from."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int, cuts: bool) -> None:
        self.room = room
        self.cuts = cuts
        self.write_told, self._truncate = os.write, os.ftruncate
        monkeypatch.setattr(os, "write", self.write)
        monkeypatch.setattr(os, "ftruncate", self.ftruncate)

    def write(self, descriptor: int, data: bytes) -> int:
        if not self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = self.write_told(descriptor, data[: self.room])
        self.room -= written
        return written

    def ftruncate(self, descriptor: int, length: int) -> None:
        if not self.cuts:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self._truncate(descriptor, length)


@pytest.mark.parametrize(("room", "cuts"), [(0, True), (1, True), (40, True), (40, False)])
def test_a_full_disk_leaves_the_journal_unchanged(path: Path, monkeypatch, room: int, cuts: bool) -> None:
    """Half a line that could not be cut off is cut off before the next."""
    with Journal(path) as journal:
        journal.append(TOLD[0])
        before = path.read_bytes()
        disk = FullDisk(monkeypatch, room, cuts)
        with pytest.raises(FileError, match="disk is full"):
            journal.append(TOLD[1])
        assert (path.read_bytes() == before) is cuts
        assert read_journal(path) == journal.events == TOLD[:1]
        disk.cuts, disk.room = True, 10_000
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]


@pytest.mark.parametrize("name", ["ftruncate", "fsync"])
def test_a_journal_that_can_never_be_opened_is_reported(path: Path, monkeypatch, name: str) -> None:
    path.write_bytes(b'{"n":1,')  # a torn line, which is cut off
    with monkeypatch.context() as patch:
        patch.setattr(os, name, Mock(side_effect=OSError(errno.EROFS, os.strerror(errno.EROFS))))
        with pytest.raises(FileError, match="the journal cannot be opened: the file system is read-only"):
            Journal(path)
    with Journal(path):
        pass


def test_partial_writes_are_continued_to_a_whole_line(path: Path, monkeypatch) -> None:
    write = os.write
    with Journal(path) as journal:
        monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:7]))
        journal.append(TOLD[0])
    assert read_journal(path) == TOLD[:1]


def test_an_event_that_cannot_be_synced_is_not_in_the_journal(path: Path, monkeypatch) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", Mock(side_effect=OSError(errno.EIO, os.strerror(errno.EIO))))
            with pytest.raises(FileError, match="disk reports an error"):
                journal.append(TOLD[1])
        assert journal.events == TOLD[:1]
    assert read_journal(path) == TOLD[:1]


def test_text_that_cannot_be_encoded_is_refused_and_nothing_is_written(path: Path) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with pytest.raises(FileError, match="cannot be written"):
            journal.append(events.Committed(approved_by=b"\xff".decode(errors="surrogateescape")))
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]
