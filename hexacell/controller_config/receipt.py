"""What a commit keeps in the run folder, so that it can be undone at any later time."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from hexacell.controller_config.change import ConfigChange, JsonRecord
from hexacell.errors import FileError
from hexacell.storage import atomic_files

BEFORE = "config-before"
AFTER = "config-after"
RECEIPT = "write-back.json"
FOUND = "config-found"


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
        """The config as it was before; raises ``FileError`` if the backup is gone or damaged."""
        data = atomic_files.read_bytes(self.backup_folder / BEFORE)
        if atomic_files.sha256(data) != self.sha256_before:
            raise FileError(
                "the backup is damaged",
                subject=self.backup_folder / BEFORE,
                action="Restore it from another backup",
            )
        return data
