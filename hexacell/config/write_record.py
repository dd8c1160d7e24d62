"""A write into a controller's config, recorded: when, who, what and why.

The records of a cell are lines of JSON in a file beside its run folders, and stay when runs are deleted.
Whoever writes a config holds the cell, so no two processes add a record at once. The config comes first: a
record that cannot be written undoes nothing. Each line is on the disk before the next is begun, and
begins on a line of its own: what a power cut or a full disk tears costs no other.
"""

import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError

from hexacell.cell.fields import LONGEST_TEXT, Finite, Frozen, Text
from hexacell.config.change import JsonRecord
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout, fingerprint
from hexacell.config.versions import config_if_readable, numbers_of
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.runs.cell_lock import user_name
from hexacell.runs.run_folder import RunFolder
from hexacell.storage import atomic_files

RECORDS = "config-writes.jsonl"
"""The file of them, beside the run folders of a cell."""

THE_RUN = "the run"
"""Who decided what no person did."""


class WriteKind(StrEnum):
    """What a config was written for."""

    RESULT = "result"
    APPLIED = "applied"
    ROLLED_BACK = "rolled back"
    TAKEN_BACK = "taken back"
    PROVISIONAL = "provisional"
    PROVISIONAL_TAKEN_BACK = "provisional taken back"


class NumberChange(Frozen):
    """One number of a geometry or of the corrections, and by how much it changed, in its unit."""

    name: str
    change: Finite
    unit: str


class WriteRecord(Frozen):
    """One write into a controller's config.

    Attributes:
        at: when it was complete, UTC.
        by: who decided on it, as the journal and ``applied.json`` have it.
        user, host: whose process wrote it, and on which computer; empty where no record was kept then.
        run: the name of the run whose geometry was written or undone; empty where there is none.
        files: of the config, the first one first.
        numbers_changed, largest: how many numbers of the geometry and the corrections changed, and the one
            that changed most (a milliradian counts as a millimetre); None where that is not known.
        why: what the program knows of the cause.
        reason: what the person gave as one.
    """

    version: Literal[1] = 1
    at: datetime
    kind: WriteKind
    by: str
    user: str = ""
    host: str = ""
    run: str = ""
    files: tuple[Path, ...]
    sha256_before: str = ""
    sha256_after: str = ""
    numbers_changed: int | None = None
    largest: NumberChange | None = None
    why: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class WriteCause:
    """Why a config is written, by whose decision, and which run's geometry it is."""

    kind: WriteKind
    by: str
    run: str
    why: str
    reason: str = ""


@dataclass(slots=True)
class Recording:
    """What became of a record; ``problem`` is why it could not be kept, in a sentence, empty if it was."""

    problem: str = ""


def stated_reason(text: str) -> str:
    """What a person gives as the reason of a write; raises ``UsageError`` where it is no line of text."""
    try:
        return TypeAdapter(Text).validate_python(text.strip())
    except ValidationError as error:
        raise UsageError(
            f"a reason is one line of at most {LONGEST_TEXT} letters", action="Shorten --reason"
        ) from error


@contextmanager
def recorded_write(
    folder: Path, paths: tuple[Path, ...], layout: ConfigLayout, cause: WriteCause
) -> Iterator[Recording]:
    """Record what the context writes into a config; nothing where it raises or writes nothing.

    ``folder`` is that of the cell's runs, ``layout`` how the geometry is read from the files.
    """
    before = _version(paths, layout)
    recording = Recording()
    yield recording
    try:
        after = _version(paths, layout)
        if after[0] != before[0]:
            atomic_files.create_folder_durably(folder)
            line = _record(paths, before, after, cause, layout).model_dump_json().encode()
            append_line(folder / RECORDS, line)
    except (HexacellError, OSError, ValueError) as error:
        recording.problem = f"The config is written, but the history has no record of it: {error}"


def read_records(folder: Path) -> tuple[tuple[WriteRecord, ...], tuple[int, ...]]:
    """The records of a cell, in their order, and the lines that are torn, damaged or of a newer program.

    Raises:
        FileError: the file cannot be read; where it does not exist there are no records.
    """
    data = atomic_files.read_if_present(folder / RECORDS) or b""
    records, damaged = [], []
    for number, line in enumerate(data.split(b"\n"), start=1):
        try:
            if line:
                records.append(WriteRecord.model_validate_json(line))
        except ValidationError:
            damaged.append(number)
    return tuple(records), tuple(damaged)


_Version = tuple[str, ControllerGeometry | None]


def _version(paths: tuple[Path, ...], layout: ConfigLayout) -> _Version:
    """The fingerprint of a config now, and what it states; empty and None where it cannot be read."""
    try:
        return fingerprint(*paths), config_if_readable(paths, layout)
    except FileError:
        return "", None


def _record(
    paths: tuple[Path, ...], before: _Version, after: _Version, cause: WriteCause, layout: ConfigLayout
) -> WriteRecord:
    changes = _changes(before[1], after[1], layout)
    return WriteRecord(
        **asdict(cause),
        at=datetime.now(UTC),
        user=user_name(),
        host=socket.gethostname(),
        files=tuple(path.absolute() for path in paths),
        sha256_before=before[0],
        sha256_after=after[0],
        numbers_changed=None if changes is None else len(changes),
        largest=changes[0] if changes else None,
    )


_LIKE_A_MM = {str(unit): unit.like_a_mm for unit in ParameterUnit} | {"um/N": 10.0}
"""What counts as much as a millimetre; a compliance under a hundred newtons. A weight is no length."""


def _changes(
    before: ControllerGeometry | None, after: ControllerGeometry | None, layout: ConfigLayout
) -> list[NumberChange] | None:
    if before is None or after is None:
        return None
    changes = [
        NumberChange(name=name, change=new - old, unit=unit)
        for name, unit, (old, new) in numbers_of([before, after], layout)
        if new != old
    ]
    return sorted(changes, key=lambda one: -abs(one.change) / _LIKE_A_MM.get(one.unit, np.inf))


# A link would lead what is appended to another file; a pipe would be waited for.
_FLAGS = os.O_RDWR | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
_NEW_FILE = 0o644
_FOR_GROUP = 0o020


def append_line(path: Path, line: bytes) -> None:
    """Add a line, given without its line feed; one process at a time may do that. Raises ``FileError``.

    Whoever may put files into the folder as a member of its group may add lines to a new file, too.
    """
    with atomic_files.os_errors("cannot be written", path):
        is_new = True
        try:
            descriptor = os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, _NEW_FILE)
        except FileExistsError:
            descriptor, is_new = os.open(path, _FLAGS), False
        try:
            if is_new:
                with suppress(OSError):
                    os.fchmod(descriptor, _NEW_FILE | (path.parent.stat().st_mode & _FOR_GROUP))
                    atomic_files.sync_folder(path.parent)
            _append(descriptor, path, line + b"\n")
        finally:
            os.close(descriptor)


def _append(descriptor: int, path: Path, line: bytes) -> None:
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        raise FileError("this is not a file", subject=path, action="Move it away")
    is_torn = status.st_size > 0 and os.pread(descriptor, 1, status.st_size - 1) != b"\n"
    rest = b"\n" + line if is_torn else line
    try:
        while rest:  # a disk that is nearly full takes a part first
            rest = rest[os.write(descriptor, rest) :]
        os.fsync(descriptor)
    except OSError:
        with suppress(OSError):
            os.ftruncate(descriptor, status.st_size)
        raise


class LaterApproval(JsonRecord):
    """Who had a proposal written after its run, and when: ``applied.json`` in the run folder."""

    noun: ClassVar[str] = "approval of a proposal"

    by: str
    at: datetime
    sha256_after: str


def later_approval(folder: RunFolder) -> LaterApproval | None:
    """Who had the proposal of a run written after it; None if nobody did. Raises ``FileError``."""
    path = approval_path(folder)
    return LaterApproval.load(path) if path.exists() else None


def approval_path(folder: RunFolder) -> Path:
    """Where that is noted."""
    return folder.path / "applied.json"
