"""A config change written into the controller's config, and its rollback.

The order makes it safe. First the backup, the new text and the receipt are written to the disk; then the
config is replaced in one step; then it is read back. If the process or the power fails at any moment, the
config is the old one or the new one, and if it is the new one, the receipt that undoes it exists.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import ClassVar, NoReturn

from hexacell.controller_config.change import ConfigChange, JsonRecord, require_fingerprint
from hexacell.errors import FileError, HexacellError, WriteBackUndone
from hexacell.storage import atomic_files

BEFORE = "config-before"
AFTER = "config-after"
RECEIPT = "write-back.json"


class Receipt(JsonRecord):
    """What a commit did, and where the backup is.

    ``backup_folder`` is where the receipt was found; a run folder may be moved.
    """

    noun: ClassVar[str] = "receipt of a write-back"

    path: Path
    format: str
    sha256_before: str
    sha256_after: str
    backup_folder: Path

    @classmethod
    def of(cls, folder: Path) -> Receipt:
        """The receipt kept in a run folder; raises ``FileError``."""
        return cls.load(folder / RECEIPT).model_copy(update={"backup_folder": folder.absolute()})

    @classmethod
    def for_change(cls, change: ConfigChange, backup_folder: Path) -> Receipt:
        """The receipt that a commit of ``change`` keeps in ``backup_folder``."""
        return cls(
            path=change.path,
            format=change.format,
            sha256_before=change.sha256_before,
            sha256_after=change.sha256_after,
            backup_folder=backup_folder.absolute(),
        )

    def backup(self) -> bytes:
        """The config before the change; raises ``FileError`` if the backup is gone or damaged."""
        data = atomic_files.read_bytes(self.backup_folder / BEFORE)
        if atomic_files.sha256(data) != self.sha256_before:
            raise FileError(
                "the backup is damaged",
                subject=self.backup_folder / BEFORE,
                action="Restore it from another backup",
            )
        return data


def commit(change: ConfigChange, backup_folder: Path) -> Receipt:
    """Write ``change`` into the controller's config.

    ``backup_folder`` gets the text before and after and the receipt. A commit that is complete already, and
    was interrupted before it returned, returns its receipt again.

    Raises:
        FileError: nothing was replaced: the config changed since the run began, or something cannot be
            written. Only if the message says so, the new config is in place and could not be undone.
        WriteBackUndone: it failed after the replacement; the config is unchanged.
    """
    receipt = Receipt.for_change(change, backup_folder)
    before, after = change.text_before.encode(), change.text_after.encode()
    found = atomic_files.read_bytes(change.path)
    if found == after and _is_complete(receipt):
        return receipt
    require_fingerprint(change.path, found, change.sha256_before)
    _back_up(receipt, before, after)
    if before != after:
        _replace(receipt, before, after)
    return receipt


def rollback(receipt: Receipt) -> None:
    """Restore the config of before the commit, byte for byte; may be repeated.

    Raises:
        FileError: the config is not the one that was written, the backup is missing, or the config cannot
            be written; the message says so if it was replaced nevertheless.
    """
    before = receipt.backup()
    found = atomic_files.read_bytes(receipt.path)
    if found == before:
        return
    if atomic_files.sha256(found) != receipt.sha256_after:
        raise FileError(
            "the config was changed since it was written; rolling back would lose that change",
            subject=receipt.path,
            action=f"Review it; if it may be lost, copy {receipt.backup_folder / BEFORE} over it",
        )
    restore(receipt.path, before, expected=found)


def restore(path: Path, data: bytes, *, expected: bytes) -> None:
    """Replace the config by an earlier version in one step, while it is as ``expected``, and read it back.

    Raises:
        FileError: it has changed, or cannot be written.
    """
    atomic_files.write_atomically(path, data, expected=expected)
    _require_written(path, data)


def _is_complete(receipt: Receipt) -> bool:
    try:
        return Receipt.of(receipt.backup_folder) == receipt and bool(receipt.backup())
    except FileError:
        return False


def _back_up(receipt: Receipt, before: bytes, after: bytes) -> None:
    folder = receipt.backup_folder
    atomic_files.create_folder_durably(folder)
    if atomic_files.read_if_present(folder / BEFORE) not in {None, before}:
        raise FileError(
            "this folder already holds the backup of another version",
            subject=folder / BEFORE,
            action="Use another folder for each write-back",
        )
    for name, data in ((BEFORE, before), (AFTER, after), (RECEIPT, receipt.to_json())):
        atomic_files.write_atomically(folder / name, data, like=receipt.path)
    receipt.backup()


def _replace(receipt: Receipt, before: bytes, after: bytes) -> None:
    try:
        atomic_files.write_atomically(receipt.path, after, expected=before)
    except BaseException as error:
        # Undo only if the new text is in place; otherwise nothing was replaced.
        if _content(receipt.path) in {after, None}:
            _undo(receipt, before, error)
        raise
    try:
        _require_written(receipt.path, after)
    except BaseException as error:
        _undo(receipt, before, error)


def _undo(receipt: Receipt, before: bytes, cause: BaseException) -> NoReturn:
    _keep_foreign_version(receipt, _content(receipt.path))
    try:
        atomic_files.write_atomically(receipt.path, before)
        _require_written(receipt.path, before)
    except FileError as error:
        if _content(receipt.path) != before:
            raise _not_undone(receipt, cause, error) from cause
    if not isinstance(cause, Exception):
        raise cause
    raise WriteBackUndone(
        f"the write-back failed and was undone, the config is unchanged ({_reason(cause)})",
        subject=receipt.path,
        action="Correct that and apply the change again",
    ) from cause


def _not_undone(receipt: Receipt, cause: BaseException, error: FileError) -> FileError:
    return FileError(
        f"the write-back failed ({_reason(cause)}) and could not be undone ({_reason(error)}); "
        "the config may hold the new geometry",
        subject=receipt.path,
        action=f"Do not move the robot; copy {receipt.backup_folder / BEFORE} over the config",
    )


def _reason(error: BaseException) -> str:
    return error.problem if isinstance(error, HexacellError) else repr(error)


def _keep_foreign_version(receipt: Receipt, found: bytes | None) -> None:
    """Keep a version that no commit wrote beside the backup, if possible, so that it is not lost."""
    if found is None or atomic_files.sha256(found) in {receipt.sha256_before, receipt.sha256_after}:
        return
    with suppress(FileError):
        atomic_files.write_atomically(
            receipt.backup_folder / f"config-found-{atomic_files.sha256(found)[:12]}",
            found,
            like=receipt.path,
        )


def _require_written(path: Path, expected: bytes) -> None:
    if atomic_files.read_bytes(path) != expected:
        raise FileError("the file does not contain what was written", subject=path, action="Check the disk")


def _content(path: Path) -> bytes | None:
    try:
        return atomic_files.read_bytes(path)
    except FileError:
        return None
