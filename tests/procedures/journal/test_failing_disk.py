"""A full or broken disk leaves the journal unchanged, and the reason is reported."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from hexacell.errors import FileError
from procedures.journal.journal import Journal, read_journal
from procedures.steps import events
from tests.procedures.journal.told import TOLD


class FullDisk:
    """A disk with room for some more bytes; its faults come from the calls they would come from."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int, *, cuts: bool = True) -> None:
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


@pytest.mark.parametrize("room", [0, 1, 40])
def test_a_full_disk_leaves_the_journal_unchanged(path: Path, monkeypatch, room: int) -> None:
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
def test_a_journal_that_can_never_be_opened_is_reported(path: Path, monkeypatch, name: str) -> None:
    def broken(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    path.write_bytes(b'{"n":1,')  # a torn line, which is cut off
    with monkeypatch.context() as patch:
        patch.setattr(os, name, broken)
        with pytest.raises(FileError, match="the journal cannot be opened: the file system is read-only"):
            Journal(path)
    Journal(path).close()


def test_partial_writes_are_continued_to_a_whole_line(path: Path, monkeypatch) -> None:
    write = os.write
    with Journal(path) as journal:
        monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:7]))
        journal.append(TOLD[0])
    assert read_journal(path) == TOLD[:1]


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


def test_an_event_that_cannot_be_synced_is_not_in_the_journal(path: Path, monkeypatch) -> None:
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


def test_text_that_cannot_be_encoded_is_refused_and_nothing_is_written(path: Path) -> None:
    with Journal(path) as journal:
        journal.append(TOLD[0])
        with pytest.raises(FileError, match="cannot be written"):
            journal.append(events.Committed(approved_by=b"\xff".decode(errors="surrogateescape")))
        journal.append(TOLD[1])
    assert read_journal(path) == TOLD[:2]
