"""What a write leaves in its run folder (versions, receipt), and what was edited since then."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from hexacell.config.change import ConfigChange, JsonRecord, diff_of_files
from hexacell.config.layout import ConfigLayout, Contents, fingerprint_of, read_contents
from hexacell.errors import FileError, HexacellError
from hexacell.kinematics.geometry import Geometry

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


@dataclass(frozen=True, slots=True)
class NumberVersions:
    """One number of the geometry in three versions of a config, in its unit.

    ``now`` is None where the current config has no geometry that can be read.
    """

    name: str
    unit: str
    before: float
    written: float
    now: float | None

    @property
    def is_edited(self) -> bool:
        """Whether the current number is from neither of the other two versions."""
        return self.now is not None and self.now not in {self.before, self.written}


@dataclass(frozen=True, slots=True)
class ConfigVersions:
    """The numbers that are not the same in all three versions, and the edit as a text change.

    Attributes:
        edit: the changes from the most similar version to the current config, as a unified diff.
        is_from_written: whether that is the version which the run wrote.
    """

    numbers: tuple[NumberVersions, ...]
    edit: str
    is_from_written: bool


class ConfigEditedSince(FileError):
    """The config is neither as it was before a run nor as the run wrote it.

    Attributes:
        versions: all three.
    """

    def __init__(self, problem: str, versions: ConfigVersions, *, path: Path, action: str) -> None:
        super().__init__(problem, subject=path, action=action)
        self.versions = versions


def compare_versions(
    paths: tuple[Path, ...],
    layout: ConfigLayout,
    before: tuple[Geometry, Contents],
    written: tuple[Geometry, Contents],
) -> ConfigVersions:
    """Compare the config in these files with two versions of it, each a geometry and what the files held.

    Raises:
        FileError: a file cannot be read.
    """
    now = read_contents(paths)
    edits = [diff_of_files(paths, version, now) for _, version in (before, written)]
    is_from_written = len(edits[1]) <= len(edits[0])
    numbers = _numbers(before[0], written[0], _geometry_now(paths, layout))
    return ConfigVersions(numbers, edits[is_from_written], is_from_written)


def _geometry_now(paths: tuple[Path, ...], layout: ConfigLayout) -> Geometry | None:
    try:
        return layout.read(*paths).geometry
    except HexacellError:
        return None


def _numbers(before: Geometry, written: Geometry, now: Geometry | None) -> tuple[NumberVersions, ...]:
    parameters = before.parameters.parameters
    last = [None] * len(parameters) if now is None else now.vector.tolist()
    values = zip(parameters, before.vector.tolist(), written.vector.tolist(), last, strict=True)
    found = (NumberVersions(one.name, one.kind.unit.value, *three) for one, *three in values)
    return tuple(one for one in found if len({one.before, one.written, one.now}) > 1)
