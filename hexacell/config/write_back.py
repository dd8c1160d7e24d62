"""A config change written into the controller's config, and its rollback.

The order makes it safe. First the backup, the new text and the receipt are written to the disk; then the
config is replaced in one step; then it is read back. If the process or the power fails at any moment, the
config is the old one or the new one, and if it is the new one, the receipt that undoes it exists.

Of several files, each is replaced in a step of its own. What a process that dies between two steps leaves
behind, the next one settles (:mod:`~hexacell.config.pending_write`).
"""

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn

from hexacell.config.change import AFTER, BEFORE, RECEIPT, ConfigChange, Receipt, require_fingerprint
from hexacell.config.layout import Contents, fingerprint_of, read_contents
from hexacell.config.pending_write import forget_write, note_write
from hexacell.errors import FileError, HexacellError, WriteBackUndone
from hexacell.storage import atomic_files

_log = logging.getLogger(__name__)


def commit(change: ConfigChange, backup_folder: Path) -> Receipt:
    """Write ``change`` into the controller's config.

    ``backup_folder`` gets the texts before and after and the receipt. A commit that is complete already,
    and was interrupted before it returned, returns its receipt again.

    Raises:
        FileError: nothing was replaced: the config changed since the run began, or something cannot be
            written. Only if the message says so, the new config is in place and could not be undone.
        WriteBackUndone: it failed after the replacement; the config is unchanged.
    """
    same = change.model_dump(include={"path", "format", "sha256_before", "sha256_after"})
    receipt = Receipt(**same, backup_folder=backup_folder.absolute(), further=change.paths[1:])
    before, after = change.before_contents, change.after_contents
    found = read_contents(change.paths)
    if found == after and _is_complete(receipt):
        return receipt
    for path, data, expected in zip(change.paths, found, before, strict=True):
        require_fingerprint(path, (data,), fingerprint_of((expected,)))
    _back_up(receipt, before, after)
    _replace(receipt, Replacement(change.paths, before, after))
    _log.info("wrote %s; the previous version is in %s", _names(change.paths), backup_folder)
    return receipt


def rollback(receipt: Receipt) -> None:
    """Restore the config as it was before the commit, byte for byte; may be repeated.

    Raises ``FileError`` if the config is not the one that was written, the backup is missing, or the config
    cannot be written; the message says so if it was replaced nevertheless.
    """
    before = receipt.backup()
    found = read_contents(receipt.paths)
    if found == before:
        return
    if fingerprint_of(found) != receipt.sha256_after:
        path, copy = _edited(receipt, found, before)
        problem = "the config was changed since it was written; rolling back would lose that change"
        raise FileError(problem, subject=path, action=f"Review it; if it may be lost, copy {copy} over it")
    restore(receipt.paths, before, expected=found)


def restore(paths: tuple[Path, ...], contents: Contents, *, expected: Contents) -> None:
    """Replace the config by an earlier version, while it is as ``expected``, and read it back.

    If it has changed or cannot be written, that is a ``FileError``, and of several files none is replaced.
    If even that fails, the next command that uses the cell does it.
    """
    replacement = Replacement(paths, expected, contents)
    try:
        replacement.write()
        replacement.finish()
        _log.info("restored an earlier version of %s", _names(paths))
    except BaseException:
        if len(replacement.changed) > 1:
            with suppress(FileError):
                replacement.restore(all_of_them=False)
        raise


def _names(paths: Sequence[Path]) -> str:
    return " and ".join(map(str, paths))


def _edited(receipt: Receipt, found: Contents, before: Contents) -> tuple[Path, Path]:
    """A file that is neither as before nor as written, and the copy that was made before the write."""
    files = list(zip(receipt.paths, receipt.kept(BEFORE), strict=True))
    with suppress(FileError):
        for file, data, *known in zip(files, found, before, receipt.written(), strict=True):
            if data not in known:
                return file
    return files[0]


def _is_complete(receipt: Receipt) -> bool:
    try:
        return Receipt.of(receipt.backup_folder) == receipt and bool(receipt.backup())
    except FileError:
        return False


def _back_up(receipt: Receipt, before: Contents, after: Contents) -> None:
    folder = receipt.backup_folder
    atomic_files.create_folder_durably(folder)
    for path, data in zip(receipt.kept(BEFORE), before, strict=True):
        if atomic_files.read_if_present(path) not in {None, data}:
            problem = "this folder already holds the backup of another version"
            raise FileError(problem, subject=path, action="Use another folder for each write-back")
    for name, contents in ((BEFORE, before), (AFTER, after)):
        for path, data, like in zip(receipt.kept(name), contents, receipt.paths, strict=True):
            atomic_files.write_own(path, data, like=like)
    receipt.save(folder / RECEIPT, like=receipt.path)
    receipt.backup()


def _replace(receipt: Receipt, replacement: "Replacement") -> None:
    try:
        replacement.write()
    except BaseException as error:
        # Undo only if a new text is in place, or may be; otherwise nothing was replaced.
        if any(one.present in {one.new, None} for one in replacement.changed):
            _undo(receipt, replacement, error, all_of_them=False)
        with suppress(FileError):
            replacement.forget()
        raise
    try:
        replacement.finish()
    except BaseException as error:
        _undo(receipt, replacement, error, all_of_them=True)


def _undo(
    receipt: Receipt, replacement: "Replacement", cause: BaseException, *, all_of_them: bool
) -> NoReturn:
    def keep(found: bytes) -> None:
        """Keep a version that no commit wrote beside the backup, if possible, so that it is not lost."""
        with suppress(FileError):
            name = f"config-found-{atomic_files.sha256(found)[:12]}"
            atomic_files.write_own(receipt.backup_folder / name, found, like=receipt.path)

    try:
        replacement.restore(all_of_them=all_of_them, keep=keep)
    except FileError as error:
        if any(one.present != one.old for one in replacement.changed):
            raise FileError(
                f"the write-back failed ({_reason(cause)}) and could not be undone ({_reason(error)}); "
                "the config may hold the new geometry",
                subject=receipt.path,
                action=f"Do not move the robot; copy {_names(receipt.kept(BEFORE))} over the config",
            ) from cause
    if not isinstance(cause, Exception):
        raise cause
    raise WriteBackUndone(
        f"the write-back failed and was undone, the config is unchanged ({_reason(cause)})",
        subject=receipt.path,
        action="Correct that and apply the change again",
    ) from cause


def _reason(error: BaseException) -> str:
    return error.problem if isinstance(error, HexacellError) else repr(error)


class ReplacedFile(NamedTuple):
    """One file that gets another content."""

    path: Path
    old: bytes
    new: bytes

    @property
    def present(self) -> bytes | None:
        """What it holds; None if it cannot be read."""
        try:
            return atomic_files.read_bytes(self.path)
        except FileError:
            return None


@dataclass(frozen=True, slots=True)
class Replacement:
    """Files that hold ``before`` and are to hold ``after``; those that stay as they are, are not touched.

    First :meth:`write`, then :meth:`finish`; where one of them fails, :meth:`restore`.
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

    def restore(self, *, all_of_them: bool, keep: Callable[[bytes], None] = lambda _: None) -> None:
        """Give the files their old content again and remove the note.

        ``all_of_them``: also those that hold neither their old nor their new content. ``keep`` is given
        what they hold, so that it is not lost; the others are somebody's edit and stay. Raises the
        ``FileError`` of the last file that could not be restored; the others were.
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
