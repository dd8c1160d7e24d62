"""The journal: what stands in it happened, and nothing that happened is lost or twice."""

from __future__ import annotations

import errno
import fcntl
import gc
import json
import os
import subprocess
import sys
import time
import zlib
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexacell.errors import CellBusy, FileError
from procedures import events, journal_lines
from procedures import journal as journal_module
from procedures.journal import Journal, read_entries, read_journal
from procedures.journal_lines import VERSION, Entry
from procedures.steps import Phase, SetKey

TOLD: tuple[Any, ...] = (
    events.Proposed(gates=(events.Gate(name="converged", passed=True, sentence="It did to 0.5 µm."),)),
    events.Committed(approved_by="a tester"),
    events.Interrupted(reason="line one\nline two\u2028\x85\r", exit_code=130),
    events.Ended(exit_code=1, line="rolled back"),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def written(path: Path) -> bytes:
    return _write(path)


def _write(path: Path) -> bytes:
    with Journal(path) as journal:
        for event in TOLD:
            journal.append(event)
    return path.read_bytes()


def test_a_new_journal_is_empty(path: Path) -> None:
    with Journal(path) as journal:
        assert journal.events == ()
    assert read_journal(path) == ()


def test_what_was_appended_is_read(path: Path, written: bytes) -> None:
    assert read_journal(path) == TOLD
    with Journal(path) as journal:
        assert journal.events == TOLD
    assert path.read_bytes() == written


def test_it_goes_on_where_it_ended(path: Path, written: bytes) -> None:
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


def test_a_tail_torn_at_any_byte_is_dropped(path: Path, written: bytes) -> None:
    begin = written.rindex(b"\n", 0, -1) + 1
    for end in range(begin, len(written)):
        path.write_bytes(written[:end])
        assert read_journal(path) == TOLD[:-1]
        with Journal(path) as journal:
            assert journal.events == TOLD[:-1]
        assert path.read_bytes() == written[:begin]


def test_after_a_torn_tail_it_goes_on(path: Path, written: bytes) -> None:
    path.write_bytes(written[:-10])
    with Journal(path) as journal:
        journal.append(TOLD[-1])
    assert read_journal(path) == TOLD


def test_a_last_line_of_garbage_is_a_torn_tail(path: Path, written: bytes) -> None:
    path.write_bytes(written + b"\x00" * 512)
    assert read_journal(path) == TOLD


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_damaged_line_before_the_last_is_refused_with_its_number(
    path: Path, written: bytes, number: int
) -> None:
    lines = written.split(b"\n")
    for place in range(0, len(lines[number - 1]), 7):
        line = bytearray(lines[number - 1])
        line[place] ^= 0x01
        path.write_bytes(b"\n".join([*lines[: number - 1], bytes(line), *lines[number:]]))
        with pytest.raises(FileError, match="damaged") as refusal:
            read_journal(path)
        assert refusal.value.line == number
        assert refusal.value.subject == str(path)


def test_opening_a_damaged_journal_leaves_it_alone(path: Path, written: bytes) -> None:
    damaged = written.replace(b"a tester", b"a taster")
    path.write_bytes(damaged)
    with pytest.raises(FileError, match=r":2: .*damaged"):
        Journal(path)
    assert path.read_bytes() == damaged


@pytest.mark.parametrize("order", [[0, 2, 3], [1, 0, 2, 3], [0, 0, 1, 2]])
def test_lines_left_out_exchanged_or_twice_are_damage(path: Path, written: bytes, order: list[int]) -> None:
    lines = written.splitlines(keepends=True)
    path.write_bytes(b"".join(lines[place] for place in order))
    with pytest.raises(FileError, match="damaged"):
        read_journal(path)


def test_an_event_of_a_later_version_is_refused_not_skipped(path: Path, written: bytes) -> None:
    record = {"n": 1, "at": "2026-11-20T10:30:00.000Z", "event": {"kind": "teleported"}}
    checksum = zlib.crc32(json.dumps(record, separators=(",", ":")).encode())
    line = json.dumps({**record, "crc": f"{checksum:08x}"}, separators=(",", ":")).encode()
    path.write_bytes(line + b"\n" + written.split(b"\n", 1)[1])
    with pytest.raises(FileError, match=":1: "):
        read_journal(path)


@pytest.mark.parametrize("line", [b"[]", b"3", b'"text"', b"null", b"{}", b'{"n": 1}', b"\xff\xfe"])
def test_lines_that_are_no_records_are_damage(path: Path, written: bytes, line: bytes) -> None:
    path.write_bytes(line + b"\n" + written)
    with pytest.raises(FileError, match=":1: "):
        read_journal(path)


def test_an_empty_file_is_an_empty_journal(path: Path) -> None:
    path.touch()
    assert read_journal(path) == ()


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


def test_another_process_is_refused_too(path: Path) -> None:
    script = "from pathlib import Path; from procedures.journal import Journal; import sys; "
    script += "Journal(Path(sys.argv[1]))"
    with Journal(path):
        refused = subprocess.run(
            [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False
        )
    assert "CellBusy" in refused.stderr


class FullDisk:
    """A disk with room for some more bytes; its faults come from the calls they would come from."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int, *, cuts: bool = True) -> None:
        self.room = room
        self.cuts = cuts
        self._write, self._truncate = os.write, os.ftruncate
        monkeypatch.setattr(os, "write", self.write)
        monkeypatch.setattr(os, "ftruncate", self.ftruncate)

    def write(self, descriptor: int, data: bytes) -> int:
        if not self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = self._write(descriptor, data[: self.room])
        self.room -= written
        return written

    def ftruncate(self, descriptor: int, length: int) -> None:
        if not self.cuts:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self._truncate(descriptor, length)


@pytest.mark.parametrize("room", [0, 1, 40])
def test_a_full_disk_leaves_it_as_before(path: Path, monkeypatch, room: int) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        before = path.read_bytes()
        disk = FullDisk(monkeypatch, room)
        with pytest.raises(FileError, match="disk is full"):
            journal.append(TOLD[1])
        assert path.read_bytes() == before
        assert journal.events == TOLD[:1]
        disk.room = 10_000
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]


@pytest.mark.parametrize("name", ["ftruncate", "fsync"])
def test_a_journal_that_cannot_be_opened_for_good_is_told(path: Path, monkeypatch, name: str) -> None:
    def broken(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    path.write_bytes(b'{"n":1,')  # a torn line, which is cut off
    with monkeypatch.context() as patch:
        patch.setattr(os, name, broken)
        with pytest.raises(FileError, match="the journal cannot be opened: the file system is read-only"):
            Journal(path)
    Journal(path).close()


def test_a_line_that_is_taken_in_pieces_is_whole(path: Path, monkeypatch) -> None:
    write = os.write
    with Journal(path) as journal:
        monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:7]))
        journal.append(TOLD[0])
    assert read_journal(path) == TOLD[:1]


def test_the_reason_for_half_a_line_is_the_true_one(path: Path, monkeypatch) -> None:
    with Journal(path) as journal:
        disk = FullDisk(monkeypatch, 40)

        def limited(descriptor: int, data: bytes) -> int:
            if not disk.room:
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            return disk.write(descriptor, data)

        monkeypatch.setattr(os, "write", limited)
        with pytest.raises(FileError, match=r"it may not become larger\. Raise the limit"):
            journal.append(TOLD[0])


def test_half_a_line_that_could_not_be_cut_off_is_cut_off_before_the_next(path: Path, monkeypatch) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        disk = FullDisk(monkeypatch, 40)
        real_write = disk.write

        def write_then_break(descriptor: int, data: bytes) -> int:
            disk.cuts = False
            return real_write(descriptor, data)

        monkeypatch.setattr(os, "write", write_then_break)
        with pytest.raises(FileError, match="disk is full"):
            journal.append(TOLD[1])
        assert read_journal(path) == TOLD[:1]
        disk.cuts, disk.room = True, 10_000
        monkeypatch.setattr(os, "write", real_write)
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]


def test_an_event_that_could_not_be_forced_out_did_not_happen(path: Path, monkeypatch) -> None:
    def broken(_: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with Journal(path) as journal:
        journal.append(TOLD[0])
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", broken)
            with pytest.raises(FileError, match="disk reports an error"):
                journal.append(TOLD[1])
        assert journal.events == TOLD[:1]
    assert read_journal(path) == TOLD[:1]


def checked(body: bytes) -> bytes:
    """A line with the checksum that belongs to it; ``body`` is the line without."""
    return body[:-1] + b',"crc":"%08x"}\n' % zlib.crc32(body)


def test_the_first_line_says_the_version(written: bytes) -> None:
    first, *others = (json.loads(line) for line in written.splitlines())
    assert first["version"] == VERSION
    assert not any("version" in record for record in others)


def test_a_journal_of_a_newer_version_is_refused_plainly(path: Path) -> None:
    body = b'{"n":1,"version":%d,"whatever":["comes"]}' % (VERSION + 1)
    path.write_bytes(checked(body) + b"what follows is not looked at\n")
    with pytest.raises(FileError, match=rf":1: a newer hexacell .* version {VERSION + 1}") as refusal:
        read_journal(path)
    assert refusal.value.action == "Use that hexacell, or update this one"
    before = path.read_bytes()
    with pytest.raises(FileError, match="newer"):
        Journal(path)
    assert path.read_bytes() == before


def test_a_journal_of_the_first_version_is_read_and_continued(path: Path) -> None:
    event = b'{"kind":"committed","approved_by":"a tester"}'
    body = b'{"n":1,"at":"2026-11-20T10:30:00.000Z","event":%b}' % event
    path.write_bytes(checked(body))
    (entry,) = read_entries(path)
    assert entry == Entry(1, datetime(2026, 11, 20, 10, 30, tzinfo=UTC), None, TOLD[1])
    with Journal(path) as journal:
        journal.append(TOLD[2])
    assert read_journal(path) == TOLD[1:3]


def test_a_last_line_that_is_whole_but_unknown_is_no_torn_tail(path: Path, written: bytes) -> None:
    body = b'{"n":%d,"at":"2026-11-20T10:30:00.000Z","event":{"kind":"teleported"}}' % (len(TOLD) + 1)
    path.write_bytes(written + checked(body))
    with pytest.raises(FileError, match=r":5: .*not understood .*'teleported'") as refusal:
        Journal(path)
    assert refusal.value.action == "Use the version of hexacell that wrote it"
    assert path.read_bytes().startswith(written)


@pytest.mark.parametrize("twice", [0, 3])
def test_a_last_line_that_stood_before_is_no_torn_tail(path: Path, written: bytes, twice: int) -> None:
    path.write_bytes(written + written.splitlines(keepends=True)[twice])
    with pytest.raises(FileError, match=rf":5: .*damaged: record {twice + 1} stands where record 5"):
        read_journal(path)


def zeros(data: bytes, begin: int, end: int) -> bytes:
    return data[:begin] + bytes(len(data[begin:end])) + data[end:]


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_last_line_with_zeros_for_bytes_is_a_torn_tail(path: Path, data) -> None:
    """As file systems leave it that lengthen a file before its blocks are written."""
    written = path.read_bytes() if path.exists() else _write(path)
    last = written.rindex(b"\n", 0, -1) + 1
    begin = data.draw(st.integers(last, len(written) - 1))
    end = data.draw(st.integers(begin + 1, len(written)))
    torn = path.with_name("torn")
    torn.write_bytes(zeros(written, begin, end) + bytes(data.draw(st.sampled_from([0, 1, 4096]))))
    assert read_journal(torn) == TOLD[:-1]
    with Journal(torn) as journal:
        journal.append(TOLD[-1])
    assert read_journal(torn) == TOLD


@pytest.mark.parametrize(
    "tail", [b"\n", b"\r", b"ab\rcd", b"ab\r\n", b"\x85\n", b"{}\n", b'"crc":"00000000"}\n']
)
def test_whatever_the_last_line_is_made_of_it_is_one_line(path: Path, written: bytes, tail: bytes) -> None:
    path.write_bytes(written + tail)
    assert read_journal(path) == TOLD


@pytest.mark.parametrize("tail", [b"\n\n", b"ab\ncd", b"ab\ncd\n"])
def test_two_damaged_lines_are_more_than_a_torn_tail(path: Path, written: bytes, tail: bytes) -> None:
    path.write_bytes(written + tail)
    with pytest.raises(FileError, match=r":5: .*damaged"):
        read_journal(path)


def test_a_lost_line_end_before_the_last_line_loses_no_record(path: Path, written: bytes) -> None:
    """Both lines together look like one torn tail, but the first of them had been acknowledged."""
    place = written.rindex(b"\n", 0, -1)
    path.write_bytes(written[:place] + b"\x00" + written[place + 1 :])
    with pytest.raises(FileError, match=r":3: .*damaged"):
        read_journal(path)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_cut_anywhere_it_is_a_part_of_what_was_told(path: Path, data) -> None:
    written = path.read_bytes() if path.exists() else _write(path)
    cut = path.with_name("cut")
    cut.write_bytes(written[: data.draw(st.integers(0, len(written)))])
    whole = cut.read_bytes().count(b"\n")
    assert read_journal(cut) == TOLD[:whole]


@settings(max_examples=500, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_changed_byte_is_never_a_wrong_event(path: Path, data) -> None:
    written = bytearray(path.read_bytes() if path.exists() else _write(path))
    place = data.draw(st.integers(0, len(written) - 1))
    written[place] ^= data.draw(st.integers(1, 255))
    spoiled = path.with_name("spoiled")
    spoiled.write_bytes(written)
    last = len(TOLD) - 1
    if place > path.read_bytes().rindex(b"\n", 0, -1):
        if written[place] == ord("\n"):  # the last line is two now, which no torn tail is
            with pytest.raises(FileError):
                read_journal(spoiled)
        else:
            assert read_journal(spoiled) == TOLD[:last]
        return
    with pytest.raises(FileError) as refusal:
        read_journal(spoiled)
    assert refusal.value.line == path.read_bytes().count(b"\n", 0, place) + 1


numbers = st.floats()
texts = st.text(st.characters(exclude_categories=["Cs"]))


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=texts, values=st.tuples(numbers, numbers, numbers), result=st.dictionaries(texts, numbers))
def test_every_number_and_every_text_comes_back(path: Path, text, values, result) -> None:
    key = SetKey(phase=Phase.IDENTIFY, point=1)
    told = (
        events.SetClosed(at=key, drift_mm=values),
        events.SetVoided(at=key, reason=text),
        events.Identified(result=result, held_out=()),
    )
    path.unlink(missing_ok=True)
    with Journal(path) as journal:
        for event in told:
            journal.append(event)
    assert list(map(repr, read_journal(path))) == list(map(repr, told))


def test_text_that_has_no_bytes_is_refused_and_nothing_written(path: Path) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with pytest.raises(FileError, match="cannot be written"):
            journal.append(events.Committed(approved_by=b"\xff".decode(errors="surrogateescape")))
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]


def test_a_line_without_end_does_not_fill_the_memory(path: Path, written: bytes, monkeypatch) -> None:
    monkeypatch.setattr(journal_module, "LONGEST_LINE", 2000)
    path.write_bytes(written + b"x" * 1000)
    assert read_journal(path) == TOLD
    path.write_bytes(written + b"x" * 5000)
    with pytest.raises(FileError, match=r":5: .*damaged"):
        read_journal(path)


def test_what_is_no_file_is_not_waited_for(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(FileError, match="not a file"):
        read_journal(path)
    with pytest.raises(FileError, match="not a file"):
        Journal(path)


def test_a_file_system_without_locks_is_said(path: Path, monkeypatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(FileError, match="cannot be opened"):
        Journal(path)


def test_clocks_that_jump_do_no_harm(path: Path, monkeypatch) -> None:
    """The wall's clock is set back and forth, the other one only goes on."""
    hours = iter([0, 5, -30_000, 2])
    begun = time.monotonic() - 0.001
    real = datetime.now

    class Clock:
        @staticmethod
        def now(zone: Any) -> datetime:
            return real(zone) + timedelta(hours=next(hours))

    monkeypatch.setattr(journal_lines, "datetime", Clock)
    _write(path)
    monkeypatch.undo()
    entries = read_entries(path)
    assert tuple(entry.event for entry in entries) == TOLD
    assert [entry.at.utcoffset() for entry in entries] == [timedelta(0)] * len(TOLD)
    assert entries[2].at < entries[0].at < entries[1].at
    seconds = [entry.monotonic_s for entry in entries if entry.monotonic_s is not None]
    assert len(seconds) == len(TOLD)
    assert seconds == sorted(seconds)
    assert begun <= seconds[0] <= seconds[-1] <= time.monotonic() + 0.001


def test_the_collector_of_garbage_is_left_as_it_was(path: Path, written: bytes) -> None:
    assert gc.isenabled()
    read_journal(path)
    assert gc.isenabled()
    gc.disable()
    try:
        read_journal(path)
        assert not gc.isenabled()
    finally:
        gc.enable()
