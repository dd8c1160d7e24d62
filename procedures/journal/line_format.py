"""One line of the journal: how an event is written, and how a damaged line is detected.

A line is ``{"n":7,"at":"2026-11-20T10:30:00.000Z","s":5.125,"event":{...},"crc":"89abcdef"}`` and a
line feed. The checksum is CRC-32 over the line's own bytes as they would be without it. The first
line has ``"version"`` behind ``"n"`` and begins so in every version.
"""

from __future__ import annotations

import re
import time
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from hexacell.cell.fields import first_mistake
from hexacell.errors import FileError
from procedures.steps.events import Event

VERSION = 1
"""What this program writes and reads. A new version is one in which something no longer means the same."""

RESTORE = "Restore the run folder from a copy; it cannot be continued"

_EVENTS: TypeAdapter[Event] = TypeAdapter(Event)
_FIRST = re.compile(rb'\{"n":1,"version":(\d{1,9}),')
_LINE = re.compile(
    rb'\{"n":([1-9]\d*),(?:"version":\d+,)?"at":"([^"]+)","s":(\d+\.\d+),"event":(\{.*\})}', re.DOTALL
)
_TAIL = re.compile(rb',"crc":"([0-9a-f]{8})"\}')
_TAIL_LENGTH = 18


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the journal.

    Attributes:
        number: its place in the journal, from 1; also its line in the file.
        at: when it was written, UTC, by a clock that may have been set in between.
        monotonic_s: time of a monotonic clock, for durations, s; it restarts when the machine does.
    """

    number: int
    at: datetime
    monotonic_s: float
    event: Event


def now() -> tuple[datetime, float]:
    """The time of a record: the wall's, UTC, and that of a clock which only goes forward, s."""
    return datetime.now(UTC), round(time.monotonic(), 3)


def encode(entry: Entry) -> bytes:
    """The line of an entry; raises ``ValueError`` if its text has no bytes in UTF-8, as some file names."""
    at = entry.at.isoformat(timespec="milliseconds").replace("+00:00", "Z")
    version = f'"version":{VERSION},' if entry.number == 1 else ""
    head = f'{{"n":{entry.number},{version}"at":"{at}","s":{entry.monotonic_s},"event":'
    body = (head + entry.event.model_dump_json()).encode()
    return b'%b,"crc":"%08x"}\n' % (body, _checksum(body))


def decode(line: bytes, path: Path, due: int) -> Entry | None:
    """The entry in line ``due`` of the journal ``path``, None if the line is damaged.

    Raises:
        FileError: the line is whole, but not the one that is due, or of a version or an event that
            this program does not know.
    """
    if not line.endswith(b"\n") or not is_whole(line[:-1]):
        return None
    if due == 1:
        _require_known_version(line, path)
    match = _LINE.fullmatch(line[: -_TAIL_LENGTH - 1] + b"}")
    if match is None:
        raise _foreign("it has an unknown form", path, due)
    number, at, monotonic, event = match.groups()
    if int(number) != due:
        problem = f"the journal is damaged: record {int(number)} is in the place of record {due}"
        raise FileError(problem, subject=path, line=due, action=RESTORE)
    if due == 1 and not _FIRST.match(line):
        raise _foreign("it states no version", path, due)
    try:
        found = _EVENTS.validate_json(event)
        when = datetime.fromisoformat(at.decode())
    except ValueError as error:
        reason = first_mistake(error, "the event") if isinstance(error, ValidationError) else str(error)
        raise _foreign(reason, path, due) from error
    return Entry(due, when, float(monotonic), found)


def is_whole(line: bytes) -> bool:
    """Whether a line, without its line feed, has the checksum that it states."""
    tail = _TAIL.fullmatch(line[-_TAIL_LENGTH:])
    return tail is not None and int(tail[1], 16) == _checksum(line[:-_TAIL_LENGTH])


def begins_whole(line: bytes) -> bool:
    """Whether a damaged line starts with a whole line and has more data after it.

    Then only the line feed between the two is lost. Zeros do not count as data: they were never written.
    """
    ends = (match.end() for match in _TAIL.finditer(line))
    return any(line[end + 1 :].strip(b"\0") and is_whole(line[:end]) for end in ends)


def _checksum(body: bytes) -> int:
    return zlib.crc32(b"}", zlib.crc32(body))


def _require_known_version(line: bytes, path: Path) -> None:
    stated = _FIRST.match(line)
    if stated is not None and (version := int(stated[1])) > VERSION:
        raise FileError(
            f"a newer hexacell wrote this journal: its format has version {version}, known is {VERSION}",
            subject=path,
            line=1,
            action="Use that hexacell, or update this one",
        )


def _foreign(reason: str, path: Path, due: int) -> FileError:
    problem = f"this line of the journal is not understood ({reason})"
    return FileError(problem, subject=path, line=due, action="Use the version of hexacell that wrote it")
