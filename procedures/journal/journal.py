"""The run on disk: one JSON line an event, appended, with a checksum, synced before the next.

Every line is on the disk before the next is begun, so a power cut can tear the last one only: it may
be cut off, or have zeros where its bytes should be. Such a tail is dropped: its write was never
confirmed. Anything else that is wrong is damage and refused with its line. One process writes
at a time.
"""

from __future__ import annotations

import fcntl
import gc
import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from hexacell.errors import CellBusy, FileError
from hexacell.storage import atomic_files
from procedures.journal.line_format import RESTORE, Entry, begins_whole, decode, encode, now
from procedures.steps.events import Event

_log = logging.getLogger(__name__)

LONGEST_LINE = 16 << 20
"""Bytes; no event comes near it. A file without line ends must not fill the memory."""


# A link would lead what is appended to another file.
_APPENDING = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK | os.O_NOFOLLOW


def read_journal(path: Path) -> tuple[Event, ...]:
    """All events of a journal.

    Raises:
        FileError: absent, written by a newer program, or damaged before its last line; the message
            names the line.
    """
    return tuple(entry.event for entry in read_entries(path))


def read_entries(path: Path) -> tuple[Entry, ...]:
    """All events of a journal with number and time of each; raises ``FileError``."""
    try:
        with open(path, "rb", opener=_open_without_waiting) as stream:
            return _parse(path, stream)[0]
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be read", path, error) from error


class Journal:
    """A journal open for appending.

    Raises:
        CellBusy: another process writes it.
        FileError: it cannot be opened, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._descriptor = os.open(path, _APPENDING, 0o666 & ~atomic_files.NOT_FOR_OTHERS)
        except OSError as error:
            raise self._cannot_open(error) from error
        try:
            self._hold()
            self._events, self._whole = self._read()
        except OSError as error:
            os.close(self._descriptor)
            raise self._cannot_open(error) from error
        except BaseException:
            os.close(self._descriptor)
            raise
        self._is_torn = False

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything in it, in order."""
        return tuple(self._events)

    def append(self, event: Event) -> None:
        """Add one event and sync it to the disk; after a ``FileError`` the journal is as before."""
        line = self._line(event)
        try:
            if self._is_torn:
                self._cut_off()
            self._is_torn = True
            _write_whole(self._descriptor, line)
            os.fsync(self._descriptor)
            self._is_torn = False
        except OSError as error:
            with suppress(OSError):
                self._cut_off()
            raise atomic_files.os_error_to_file_error(
                "the journal cannot be written", self.path, error
            ) from error
        self._events.append(event)
        self._whole += len(line)
        _log.info("line %d of %s: %s", len(self._events), self.path, event.kind)

    def close(self) -> None:
        """Close the file, which releases its lock."""
        os.close(self._descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _line(self, event: Event) -> bytes:
        try:
            return encode(Entry(len(self._events) + 1, *now(), event))
        except ValueError as error:
            raise FileError(
                f"the journal cannot be written: {error}",
                subject=self.path,
                action="Use file names that are text in UTF-8",
            ) from error

    def _read(self) -> tuple[list[Event], int]:
        with open(self._descriptor, "rb", closefd=False) as stream:
            entries, whole = _parse(self.path, stream)
        if os.fstat(self._descriptor).st_size > whole:
            os.ftruncate(self._descriptor, whole)
        atomic_files.sync_folder(self.path.parent)
        return [entry.event for entry in entries], whole

    def _cut_off(self) -> None:
        """Remove what a failure left of a line, perhaps now that it can be done."""
        os.ftruncate(self._descriptor, self._whole)
        self._is_torn = False

    def _hold(self) -> None:
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CellBusy("another process writes this journal", subject=self.path) from None

    def _cannot_open(self, error: OSError) -> FileError:
        return atomic_files.os_error_to_file_error("the journal cannot be opened", self.path, error)


def _open_without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # a pipe would be waited for


def _write_whole(descriptor: int, data: bytes) -> None:
    # A disk or a limit that is nearly reached takes a part, and says why only when asked for the rest.
    while data:
        data = data[os.write(descriptor, data) :]


def _parse(path: Path, stream: BinaryIO) -> tuple[tuple[Entry, ...], int]:
    """The entries, and how many bytes of the file are whole lines."""
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        raise FileError("this is not a file", subject=path, action="Check the path")
    entries: list[Entry] = []
    whole = 0
    with _collector_at_rest():
        while line := stream.readline(LONGEST_LINE):
            due = len(entries) + 1
            entry = decode(line, path, due)
            if entry is None:
                if begins_whole(line) or _has_more_data(stream):
                    problem = "this line of the journal is damaged"
                    raise FileError(problem, subject=path, line=due, action=RESTORE)
                break
            entries.append(entry)
            whole += len(line)
    return tuple(entries), whole


def _has_more_data(stream: BinaryIO) -> bool:
    return any(part.strip(b"\0") for part in iter(partial(stream.read, LONGEST_LINE), b""))


@contextmanager
def _collector_at_rest() -> Iterator[None]:
    """Many objects are made and none is garbage; looking for some would take most of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
