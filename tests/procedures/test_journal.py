"""The journal: what stands in it happened, and nothing that happened is lost or twice."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import pytest

from hexacell.errors import CellBusy, FileError
from procedures import events
from procedures.journal import Journal, read_journal

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
