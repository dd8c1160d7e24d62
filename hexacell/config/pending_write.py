"""The cell held by this process, and writes of several files at once, noted until they are complete.

One file is replaced in one step; several are not. Before the first of them is replaced, a note of what all
of them hold is written beside them and synced to the disk; it is removed once the last one is replaced and
read back. If the process is killed in between, the next one that holds the cell finds the note and restores
the old content or, where all files are new already, only removes the note.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import ClassVar

from hexacell.cell.fields import Frozen
from hexacell.config.change import JsonRecord
from hexacell.config.layout import Contents, names_of, read_contents
from hexacell.errors import CellBusy, FileError
from hexacell.runs.cell_lock import cell_lock
from hexacell.storage import atomic_files

_AS_TEXT = "latin-1"
"""Every byte is one character of it: so a file that is no text can be in a note."""


class _NotedFile(Frozen):
    path: Path
    before: str
    sha256_after: str

    @property
    def old(self) -> bytes:
        """What it held before."""
        return self.before.encode(_AS_TEXT)

    @property
    def is_changed(self) -> bool:
        """Whether it gets another content."""
        return atomic_files.sha256(self.old) != self.sha256_after


class _Note(JsonRecord):
    noun: ClassVar[str] = "note of a write"

    files: tuple[_NotedFile, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """The paths of the files."""
        return tuple(one.path for one in self.files)

    def __str__(self) -> str:
        return f"a write of {' and '.join(names_of(self.paths))} was interrupted"


def note_path(paths: Sequence[Path]) -> Path:
    """Where the note of a write of these files is, whatever their order: beside one of them.

    Raises:
        FileError: one of them is a link that cannot be read.
    """
    with atomic_files.os_errors("cannot be read", paths[0]):
        target = Path(min(os.path.realpath(path) for path in paths))
    return target.with_name(f".{target.name}.hexacell-write")


def note_write(paths: Sequence[Path], before: Contents, after: Contents) -> None:
    """Note that the files, which hold ``before``, are about to get ``after``.

    Raises:
        FileError: the note cannot be written, or somebody has put a link in its place.
    """
    place = note_path(paths)
    if os.path.islink(place):  # noqa: PTH114 - Path.is_symlink raises where that is unknown
        raise FileError("is a link, which would lead a note elsewhere", subject=place, action="Remove it")
    files = tuple(
        _NotedFile(path=path.absolute(), before=old.decode(_AS_TEXT), sha256_after=atomic_files.sha256(new))
        for path, old, new in zip(paths, before, after, strict=True)
    )
    atomic_files.write_own(place, _Note(files=files).to_json(), like=min(paths, key=_readers))


def forget_write(paths: Sequence[Path]) -> None:
    """Remove the note, if there is one: all files are new, or all are old. Raises ``FileError``."""
    path = note_path(paths)
    with atomic_files.os_errors("the note cannot be removed", path):
        path.unlink(missing_ok=True)
    # A power cut may bring the note back; then it says of complete files that they are complete.
    with suppress(OSError):
        atomic_files.sync_folder(path.parent)


def is_interrupted(paths: Sequence[Path]) -> bool:
    """Whether a write of these files was begun and is not complete; it may be going on."""
    return os.path.lexists(note_path(paths))


def settle_interrupted_write(paths: Sequence[Path]) -> str | None:
    """Undo what a process that died left of a write; what became of it, None if there is nothing.

    The caller must hold the cell: a write that is going on looks the same. Where a file was edited since,
    or cannot be written, that is a ``FileError``, and nothing else is changed.
    """
    if not is_interrupted(paths):
        return None
    path = note_path(paths)
    note = _Note.load(path)
    # What a note names is written: it must be the files of this cell, no others.
    noted, own = ({os.path.realpath(one) for one in files} for files in (note.paths, paths))
    if noted != own:
        raise FileError(
            f"{note}, which are not the files that this cell file names",
            subject=path,
            action="Use the cell file with which the write was made; its next command undoes it",
        )
    found = list(zip(note.files, read_contents(note.paths), strict=True))
    replaced = [(one, data) for one, data in found if _is_replaced(one, data, note, path)]
    is_complete = len(replaced) == sum(one.is_changed for one in note.files)
    for one, data in () if is_complete else replaced:
        atomic_files.write_atomically(one.path, one.old, expected=data)
    forget_write(paths)
    if is_complete:
        return f"{note} when all of them were new: it is complete"
    if not replaced:
        return f"{note} before any of them was replaced: all are as before"
    restored = " and ".join(names_of([one.path for one, _ in replaced]))
    return f"{note} between them: {restored} got the old content back"


def _is_replaced(one: _NotedFile, data: bytes, note: _Note, path: Path) -> bool:
    """Whether a file has its new content; raises ``FileError`` where it has neither."""
    if data == one.old:
        return False
    if atomic_files.sha256(data) == one.sha256_after:
        return True
    raise FileError(
        f"{note}, and this file was edited since: whether they belong together is not known",
        subject=one.path,
        action=f"Make all of them old or all new, from the copies in the run's folder; then delete {path}",
    )


def _readers(path: Path) -> int:
    """How many may read a file: the bits of its mode that let the group and all others."""
    with atomic_files.os_errors("cannot be read", path):
        return path.stat().st_mode & 0o044


@contextmanager
def held_config(*paths: Path) -> Iterator[None]:
    """Hold the cell whose config these files are until the context ends; never waits.

    Raises ``CellBusy`` if another process holds it, and ``FileError`` if a write of its config was
    interrupted since the command began, which is settled now.
    """
    with cell_lock(*paths):
        if (settled := settle_interrupted_write(paths)) is not None:
            raise FileError(settled, subject=paths[0], action="Try again")
        yield


def settle_config(*paths: Path) -> str | None:
    """As :func:`settle_interrupted_write`; where another process holds the cell, it is left to that one."""
    if not is_interrupted(paths):
        return None
    try:
        with cell_lock(*paths):
            return settle_interrupted_write(paths)
    except CellBusy:
        return None
