"""A proposal written into the controller's config, and the way back.

The order is what makes it safe. First the backup, the new text and the receipt are on the disk; then
the config is replaced in one step; then it is read back. Whenever the process or the power dies, the
config is the old one or the new one, and if it is the new one, the receipt that undoes it exists.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from hexacell.controller_config.change import ConfigChange, diff, fingerprint, propose, require_fingerprint
from hexacell.controller_config.receipt import AFTER, BEFORE, RECEIPT, STRANGER, Receipt
from hexacell.errors import FileError, HexacellError, WriteBackUndone
from hexacell.storage import atomic_files

__all__ = ["ConfigChange", "Receipt", "commit", "diff", "fingerprint", "propose", "rollback"]


def commit(proposal: ConfigChange, backup_folder: Path) -> Receipt:
    """Write ``proposal`` into the controller's config.

    ``backup_folder`` gets the text before and after and the receipt. A commit that was made already,
    but interrupted before its caller knew, only gives its receipt again.

    Raises:
        FileError: nothing was replaced: the config changed since the run began, or something cannot be
            written. Only if the message says so, the new config is there and could not be undone.
        WriteBackUndone: it went wrong after the replacement; the config is as it was.
    """
    receipt = Receipt.for_proposal(proposal, backup_folder)
    before, after = proposal.text_before.encode(), proposal.text_after.encode()
    found = atomic_files.read_bytes(proposal.path)
    if found == after and _is_kept(receipt):
        return receipt
    require_fingerprint(proposal.path, found, proposal.sha256_before)
    _back_up(receipt, before, after)
    if before != after:
        _replace(receipt, before, after)
    return receipt


def rollback(receipt: Receipt, *, force: bool = False) -> bool:
    """Put the config back as it was before the commit, bit for bit.

    Args:
        receipt: of the commit.
        force: also over a config that somebody changed since; that one is kept in the run folder.

    Returns:
        False if the config was as before already.

    Raises:
        FileError: the config is not the one that was written, the backup is gone, or the config cannot
            be written; the message says so if it was replaced nevertheless.
    """
    before = receipt.backup()
    found = _content(receipt.path) if force else atomic_files.read_bytes(receipt.path)
    if found == before:
        return False
    if force:
        _keep_stranger(receipt, found)
    elif atomic_files.sha256(found or b"") != receipt.sha256_after:
        raise FileError(
            "the config was changed since it was written; rolling back would lose that change",
            subject=receipt.path,
            action="Look at it, and roll back with force if it may go",
        )
    atomic_files.write_atomically(receipt.path, before, expected=found)
    _require_written(receipt.path, before)
    return True


def _is_kept(receipt: Receipt) -> bool:
    try:
        return Receipt.of(receipt.backup_folder) == receipt and bool(receipt.backup())
    except FileError:
        return False


def _back_up(receipt: Receipt, before: bytes, after: bytes) -> None:
    folder = receipt.backup_folder
    atomic_files.create_folder_durably(folder)
    if atomic_files.read_if_present(folder / BEFORE) not in {None, before}:
        raise FileError(
            "this folder already keeps the backup of another version",
            subject=folder / BEFORE,
            action="Use a folder of its own for each write-back",
        )
    for name, data in ((BEFORE, before), (AFTER, after), (RECEIPT, receipt.to_json())):
        atomic_files.write_atomically(folder / name, data)
    receipt.backup()


def _replace(receipt: Receipt, before: bytes, after: bytes) -> None:
    try:
        atomic_files.write_atomically(receipt.path, after, expected=before)
    except BaseException as error:
        # Nothing was replaced, and so there is nothing to undo, unless the new text is there.
        if _content(receipt.path) in {after, None}:
            _undo(receipt, before, error)
        raise
    try:
        _require_written(receipt.path, after)
    except BaseException as error:
        _undo(receipt, before, error)


def _undo(receipt: Receipt, before: bytes, cause: BaseException) -> NoReturn:
    _keep_stranger(receipt, _content(receipt.path))
    try:
        atomic_files.write_atomically(receipt.path, before)
        _require_written(receipt.path, before)
    except FileError as error:
        if _content(receipt.path) != before:
            raise _by_hand(receipt, cause, error) from cause
    if not isinstance(cause, Exception):
        raise cause
    raise WriteBackUndone(
        f"the write-back failed and was undone, the config is as it was ({_words(cause)})",
        subject=receipt.path,
        action="Put that right and apply the proposal again",
    ) from cause


def _by_hand(receipt: Receipt, cause: BaseException, error: FileError) -> FileError:
    return FileError(
        f"the write-back failed ({_words(cause)}) and could not be undone ({_words(error)}); "
        "the config may hold the new geometry",
        subject=receipt.path,
        action=f"Do not move the robot; copy {receipt.backup_folder / BEFORE} over the config",
    )


def _words(error: BaseException) -> str:
    return error.problem if isinstance(error, HexacellError) else repr(error)


def _keep_stranger(receipt: Receipt, found: bytes | None) -> None:
    """Lose nobody's work: a version that no commit wrote is kept beside the backup, if it can be."""
    if found is None or atomic_files.sha256(found) in {receipt.sha256_before, receipt.sha256_after}:
        return
    with suppress(FileError):
        atomic_files.write_atomically(
            receipt.backup_folder / f"{STRANGER}-{atomic_files.sha256(found)[:12]}", found
        )


def _require_written(path: Path, expected: bytes) -> None:
    if atomic_files.read_bytes(path) != expected:
        raise FileError(
            "the file does not read back as it was written", subject=path, action="Check the disk"
        )


def _content(path: Path) -> bytes | None:
    try:
        return atomic_files.read_bytes(path)
    except FileError:
        return None
