"""The run on disk: one JSON line an event, appended, checksummed, forced out before going on.

A line is ``{"n": 7, "at": "2026-11-20T10:30:00.000Z", "event": {...}, "crc": "89abcdef"}``; the
checksum is CRC-32 of the line without it. A torn last line is what a power cut leaves and is
dropped; anything wrong before it is damage and refused. One process writes at a time.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import zlib
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError

from hexacell import files
from hexacell.errors import CellBusy, FileError
from procedures.events import Event

NAME = "journal.jsonl"
_EVENTS: TypeAdapter[Event] = TypeAdapter(Event)


def read_journal(path: Path) -> tuple[Event, ...]:
    """All events of a journal.

    Raises:
        FileError: absent, or damaged before its last line; the message names the line.
    """
    return _parse(path, files.read_bytes(path))[0]


class Journal:
    """A journal open for appending.

    Raises:
        CellBusy: another process writes it.
        FileError: it cannot be opened, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise files.plain_error("the journal cannot be opened", path, error) from error
        try:
            self._hold()
            history, whole = _parse(path, files.read_bytes(path))
            self._events, self._whole = list(history), whole
            os.ftruncate(self._descriptor, whole)
            files.sync_folder(path.parent)
        except BaseException:
            os.close(self._descriptor)
            raise

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything in it, in order."""
        return tuple(self._events)

    def append(self, event: Event) -> None:
        """Add one event; when this returns, it is on the disk.

        Raises:
            FileError: it could not be written; the journal is as before.
        """
        line = _line(len(self._events) + 1, event)
        try:
            # Once more, should the last failure have left half a line and been unable to cut it off.
            os.ftruncate(self._descriptor, self._whole)
            _write_whole(self._descriptor, line)
            os.fsync(self._descriptor)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._whole)
            raise files.plain_error("the journal cannot be written", self.path, error) from error
        self._events.append(event)
        self._whole += len(line)

    def close(self) -> None:
        """Let the file and its lock go."""
        os.close(self._descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _hold(self) -> None:
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CellBusy("another process writes this journal", subject=self.path) from None


def _write_whole(descriptor: int, data: bytes) -> None:
    if os.write(descriptor, data) != len(data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _line(number: int, event: Event) -> bytes:
    at = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    record: dict[str, Any] = {"n": number, "at": at, "event": event.model_dump(mode="json")}
    return _text({**record, "crc": _checksum(record)}) + b"\n"


def _text(record: dict[str, Any]) -> bytes:
    return json.dumps(record, separators=(",", ":"), ensure_ascii=False).encode()


def _checksum(record: dict[str, Any]) -> str:
    return f"{zlib.crc32(_text(record)):08x}"


def _parse(path: Path, data: bytes) -> tuple[tuple[Event, ...], int]:
    """The events, and how many bytes of the file are whole lines."""
    parsed: list[Event] = []
    whole = 0
    for line in data.splitlines(keepends=True):
        event = _event(line, len(parsed) + 1) if line.endswith(b"\n") else None
        if event is None:
            if whole + len(line) == len(data):
                break
            raise FileError(
                "this line of the journal is damaged",
                subject=path,
                line=len(parsed) + 1,
                action="Restore the run folder from a copy; it cannot be continued",
            )
        parsed.append(event)
        whole += len(line)
    return tuple(parsed), whole


def _event(line: bytes, number: int) -> Event | None:
    try:
        record = json.loads(line)
        checksum = record.pop("crc")
        if record["n"] != number or checksum != _checksum(record):
            return None
        return _EVENTS.validate_python(record["event"])
    except (ValueError, KeyError, TypeError, AttributeError, ValidationError):
        return None
