"""What a write into the controller's config leaves in its run folder: the versions and the receipt."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from hexacell.config.change import ConfigChange, JsonRecord
from hexacell.config.contents import Contents, fingerprint_of, read_contents
from hexacell.errors import FileError

BEFORE = "config-before"
AFTER = "config-after"
RECEIPT = "write-back.json"


def kept_paths(folder: Path, name: str, count: int) -> tuple[Path, ...]:
    """Where a folder keeps so many files of a config; ``name`` is ``BEFORE`` or ``AFTER``."""
    return (folder / name, *(folder / f"{name}-{number}" for number in range(2, count + 1)))


class Receipt(JsonRecord):
    """What a commit did, and where the backup is.

    ``further`` are the files of the config beside ``path``; ``backup_folder`` is where the receipt was
    found; a run folder may be moved.
    """

    noun: ClassVar[str] = "receipt of a write-back"

    path: Path
    format: str
    sha256_before: str
    sha256_after: str
    backup_folder: Path
    further: tuple[Path, ...] = ()

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
            further=change.paths[1:],
        )

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files of the config, the first one first."""
        return (self.path, *self.further)

    def kept(self, name: str) -> tuple[Path, ...]:
        """Where the copies of these files are; ``name`` is ``BEFORE`` or ``AFTER``."""
        return kept_paths(self.backup_folder, name, len(self.paths))

    def backup(self) -> Contents:
        """The config before the change; raises ``FileError`` if the backup is gone or damaged."""
        return self._whole(BEFORE, self.sha256_before, "the backup is damaged")

    def written(self) -> Contents:
        """The config as it was written; raises ``FileError`` if that copy is gone or damaged."""
        return self._whole(AFTER, self.sha256_after, "this copy of the config is damaged")

    def _whole(self, name: str, sha256: str, problem: str) -> Contents:
        found = read_contents(self.kept(name))
        if fingerprint_of(found) != sha256:
            raise FileError(
                problem, subject=self.backup_folder / name, action="Restore it from another backup"
            )
        return found
