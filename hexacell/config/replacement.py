"""New contents for the files of a config: all of them are replaced, or none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hexacell.config.contents import Contents
from hexacell.config.pending_write import forget_write, note_write
from hexacell.errors import FileError
from hexacell.storage import atomic_files


class ReplacedFile(NamedTuple):
    """One file that gets another content."""

    path: Path
    old: bytes
    new: bytes

    @property
    def present(self) -> bytes | None:
        """What it holds; none if it cannot be read."""
        try:
            return atomic_files.read_bytes(self.path)
        except FileError:
            return None


@dataclass(frozen=True, slots=True)
class Replacement:
    """Files that hold ``before`` and are to hold ``after``; those that stay as they are, are not touched.

    First :meth:`write`, then :meth:`finish`; where one of them fails, :meth:`put_back`.
    """

    paths: tuple[Path, ...]
    before: Contents
    after: Contents

    @property
    def changed(self) -> tuple[ReplacedFile, ...]:
        """The files that do not stay as they are."""
        every = (ReplacedFile(*one) for one in zip(self.paths, self.before, self.after, strict=True))
        return tuple(one for one in every if one.old != one.new)

    def write(self) -> None:
        """Replace the files; more than one with a note that outlives this process.

        Raises:
            FileError: a file is not as before, or cannot be written.
        """
        changed = self.changed
        if len(changed) > 1:
            for one in changed:
                atomic_files.require_replaceable(one.path)
            note_write(self.paths, self.before, self.after)
        for one in changed:
            atomic_files.write_atomically(one.path, one.new, expected=one.old)

    def finish(self) -> None:
        """Read the files back and remove the note.

        Raises:
            FileError: a file does not hold what was written, or the note cannot be removed.
        """
        for one in self.changed:
            require_written(one.path, one.new)
        self.forget()

    @property
    def has_begun(self) -> bool:
        """Whether a file has its new content, or may have it."""
        return any(one.present in {one.new, None} for one in self.changed)

    def put_back(self, *, all_of_them: bool, keep: Callable[[bytes], None] = lambda _: None) -> None:
        """Give the files their old content again and remove the note.

        ``all_of_them``: also those that hold neither their old nor their new content. ``keep`` is given
        what they hold, so that it is not lost; the others are somebody's edit and stay.

        Raises:
            FileError: of the last file that could not be put back; the others were.
        """
        failure: FileError | None = None
        for one in self.changed:
            if (found := one.present) == one.old or not (all_of_them or found in {one.new, None}):
                continue
            if found is not None and found != one.new:
                keep(found)
            try:
                atomic_files.write_atomically(one.path, one.old)
                require_written(one.path, one.old)
            except FileError as error:
                if one.present != one.old:
                    failure = error
        if failure is not None:
            raise failure
        self.forget()

    def forget(self) -> None:
        """Remove the note; raises ``FileError``."""
        if len(self.changed) > 1:
            forget_write(self.paths)


def require_written(path: Path, expected: bytes) -> None:
    """Raise ``FileError`` if a file does not hold what was written into it."""
    if atomic_files.read_bytes(path) != expected:
        raise FileError("the file does not contain what was written", subject=path, action="Check the disk")
