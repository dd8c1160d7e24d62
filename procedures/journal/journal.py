"""The run on disk: one JSON line an event, appended, with a checksum, synced before the next.

A line is ``{"n":7,"at":"2026-11-20T10:30:00.000Z","s":5.125,"event":{...},"crc":"89abcdef"}`` and a line
feed. The checksum is CRC-32 over the line's own bytes as they would be without it. The first line has
``"version"`` behind ``"n"`` and begins so in every version.

Every line is on the disk before the next is begun, so a power cut can tear the last one only: it may
be cut off, or have zeros where its bytes should be. Such a tail is dropped: its write was never
confirmed. Anything else that is wrong is damage and refused with its line. One process writes
at a time. What a run has decided rests on what it wrote; whether that is still there, in the file of that
name, is looked at before each further line, and once more before the controller's config is changed.
"""

import fcntl
import gc
import hashlib
import logging
import os
import re
import stat
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import BinaryIO

from pydantic import TypeAdapter, ValidationError

from hexacell.cell.fields import first_mistake
from hexacell.errors import CellBusy, FileError, HexacellError, flatten_errors
from hexacell.storage import atomic_files
from procedures.run.readings import Reading
from procedures.steps.events import Event

_log = logging.getLogger(__name__)

LONGEST_LINE = 16 << 20
"""Most bytes of a line; no event comes near it. A file without line ends must not fill the memory."""

# A link would lead what is appended to another file.
_APPENDING = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK | os.O_NOFOLLOW

_PART = 1 << 20

VERSION = 1
"""What this program writes and reads. A new version is one in which something no longer means the same."""

RESTORE = "Restore the run folder from a copy; it cannot be continued"


@cache  # made when the first journal is read: it takes a tenth of a second
def _events() -> TypeAdapter[Event]:
    return TypeAdapter(Event)


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


def read_journal(path: Path, longest_line: int = LONGEST_LINE) -> tuple[Event, ...]:
    """All events of a journal, none of which has more than ``longest_line`` bytes.

    Raises ``FileError`` with the line: absent, by a newer program, or damaged before its last line.
    """
    return tuple(entry.event for entry in read_entries(path, longest_line))


def read_entries(path: Path, longest_line: int = LONGEST_LINE) -> tuple[Entry, ...]:
    """All events of a journal with number and time of each; raises ``FileError``."""
    with (
        atomic_files.os_errors("cannot be read", path),
        # A pipe would be waited for.
        open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as stream,
    ):
        return _parse(path, stream, longest_line)[0]


class EvidenceLost(FileError):
    """The journal of a run is no longer what the run wrote: nothing may be done that rests on it."""


def is_evidence_lost(error: BaseException) -> bool:
    """Whether an error says, alone or among others, that the evidence of a run is lost."""
    causes = (error, error.__cause__)
    found = [one for cause in causes if isinstance(cause, HexacellError) for one in flatten_errors(cause)]
    return any(isinstance(one, EvidenceLost) for one in found)


class Journal(AbstractContextManager["Journal"]):
    """A journal open for appending; raises ``CellBusy`` if another process writes it, or ``FileError``.

    Its run had taken ``lasted_s`` when it was opened: until its last reading, and as long as that is ago.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with atomic_files.os_errors("the journal cannot be opened", path), ExitStack() as undone:
            self._descriptor = os.open(path, _APPENDING, 0o666 & ~atomic_files.NOT_FOR_OTHERS)
            undone.callback(os.close, self._descriptor)
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                problem = "another process writes this journal"
                raise CellBusy(problem, subject=path, action="End it") from None
            entries, self._whole = self._read()
            self._events, self.lasted_s = [entry.event for entry in entries], _lasted_s(entries)
            self._digest, self._times = self._digest_of_file(), self._times_of_file()
            undone.pop_all()
        self._is_torn = False

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything in it, in order."""
        return tuple(self._events)

    def append(self, event: Event) -> None:
        """Add one event and sync it to the disk; after a ``FileError`` the journal is as before.

        Raises:
            EvidenceLost: what was written before is not there any more; nothing is added.
            FileError: it cannot be written.
        """
        self.require_intact()
        line = self._line(event)
        with atomic_files.os_errors("the journal cannot be written", self.path):
            try:
                if self._is_torn:
                    self._cut_off()
                self._is_torn = True
                _write_whole(self._descriptor, line)
                os.fsync(self._descriptor)
                self._is_torn = False
            except OSError:
                with suppress(OSError):
                    self._cut_off()
                raise
        self._events.append(event)
        self._whole += len(line)
        self._digest.update(line)
        self._times = self._times_of_file()
        _log.info("line %d of %s: %s", len(self._events), self.path, event.kind)

    def require_intact(self) -> None:
        """Make sure that the file of this name is the one that is written, and holds what was written.

        It is read again only where something has touched it since it was written last.

        Raises:
            EvidenceLost: it was deleted, replaced, cut short, continued or changed.
        """
        try:
            named, held = os.lstat(self.path), os.fstat(self._descriptor)
        except OSError as error:
            why = "is gone" if isinstance(error, FileNotFoundError) else f"cannot be seen: {error.strerror}"
            raise self._lost(why) from error
        if not os.path.samestat(named, held):
            raise self._lost("was replaced by another file")
        if held.st_size < self._whole:
            raise self._lost("was cut short")
        if held.st_size > self._whole and not self._is_torn:
            raise self._lost("was written by somebody else")
        if (held.st_mtime_ns, held.st_ctime_ns) != self._times:
            self._require_content()

    def require_read_back(self) -> None:
        """As :meth:`require_intact`, by reading all of it: the times of a file have a coarse step."""
        self.require_intact()
        self._require_content()

    def _require_content(self) -> None:
        with atomic_files.os_errors("cannot be read", self.path):
            times, digest = self._times_of_file(), self._digest_of_file()
        if digest.digest() != self._digest.digest():
            raise self._lost("was changed")
        self._times = times

    def _lost(self, why: str) -> EvidenceLost:
        problem = f"the journal of this run {why}, and nothing is done that would rest on it"
        action = "Put it back as this run wrote it and resume, or begin a new run"
        return EvidenceLost(problem, subject=self.path, action=action)

    def _times_of_file(self) -> tuple[int, int]:
        status = os.fstat(self._descriptor)
        return status.st_mtime_ns, status.st_ctime_ns

    def _digest_of_file(self) -> "hashlib._Hash":
        """The sum of all whole lines, as the file has them now."""
        digest, place = hashlib.sha256(), 0
        while part := os.pread(self._descriptor, min(_PART, self._whole - place), place):
            digest.update(part)
            place += len(part)
        return digest

    def __exit__(self, *_error: object) -> None:
        os.close(self._descriptor)  # which releases its lock

    def _line(self, event: Event) -> bytes:
        try:
            return encode(Entry(len(self._events) + 1, *now(), event))
        except ValueError as error:
            raise FileError(
                f"the journal cannot be written: {error}",
                subject=self.path,
                action="Use file names that are text in UTF-8",
            ) from error

    def _read(self) -> tuple[tuple[Entry, ...], int]:
        with open(self._descriptor, "rb", closefd=False) as stream:
            entries, whole = _parse(self.path, stream)
        if os.fstat(self._descriptor).st_size > whole:
            os.ftruncate(self._descriptor, whole)
        atomic_files.sync_folder(self.path.parent)
        return entries, whole

    def _cut_off(self) -> None:
        """Remove what a failure left of a line, perhaps now that it can be done."""
        os.ftruncate(self._descriptor, self._whole)
        self._is_torn = False


def _lasted_s(entries: Sequence[Entry]) -> float:
    """The time of a run by now, s: by its last reading, and since then by the wall's clock; else 0."""
    for entry in reversed(entries):
        reading: Reading | None = getattr(entry.event, "reading", None)
        if reading is not None and reading.at_s is not None:
            return reading.at_s + max(0.0, (datetime.now(UTC) - entry.at).total_seconds())
    return 0.0


def _write_whole(descriptor: int, data: bytes) -> None:
    # A disk or a limit that is nearly reached takes a part, and says why only when asked for the rest.
    while data:
        data = data[os.write(descriptor, data) :]


def _parse(path: Path, stream: BinaryIO, longest_line: int = LONGEST_LINE) -> tuple[tuple[Entry, ...], int]:
    """The entries, and how many bytes of the file are whole lines."""
    state = os.fstat(stream.fileno())
    if not stat.S_ISREG(state.st_mode):
        raise FileError("this is not a file", subject=path, action="Check the path")
    atomic_files.require_length(path, state.st_size)

    def most() -> int:
        # What another process appends meanwhile is not read: half a line and then more would look damaged.
        return min(longest_line, state.st_size - stream.tell())

    entries: list[Entry] = []
    whole = 0
    with _collector_at_rest():
        while line := stream.readline(most()):
            due = len(entries) + 1
            if (entry := decode(line, path, due)) is None:
                parts = iter(lambda: stream.read(most()), b"")
                if begins_whole(line) or any(part.strip(b"\0") for part in parts):
                    problem = "this line of the journal is damaged"
                    raise FileError(problem, subject=path, line=due, action=RESTORE)
                break
            entries.append(entry)
            whole += len(line)
    return tuple(entries), whole


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

    Raises ``FileError`` for a whole line that is not the one that is due, or of a version or an event that
    this program does not know.
    """
    if not line.endswith(b"\n") or not is_whole(line[:-1]):
        return None
    stated = _FIRST.match(line) if due == 1 else None
    if stated is not None and (version := int(stated[1])) > VERSION:
        raise FileError(
            f"a newer hexacell wrote this journal: its format has version {version}, known is {VERSION}",
            subject=path,
            line=1,
            action="Use that hexacell, or update this one",
        )
    if (match := _LINE.fullmatch(line[: -_TAIL_LENGTH - 1] + b"}")) is None:
        raise _foreign("it has an unknown form", path, due)
    number, at, monotonic, event = match.groups()
    if int(number) != due:
        problem = f"the journal is damaged: record {int(number)} is in the place of record {due}"
        raise FileError(problem, subject=path, line=due, action=RESTORE)
    if due == 1 and stated is None:
        raise _foreign("it states no version", path, due)
    try:
        found = _events().validate_json(event)
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


def _foreign(reason: str, path: Path, due: int) -> FileError:
    problem = f"this line of the journal is not understood ({reason})"
    return FileError(problem, subject=path, line=due, action="Use the version of hexacell that wrote it")
