"""A change of the controller's config: proposed, and as written with its receipt."""

import difflib
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Literal, Self

from pydantic import ValidationError, model_validator

from hexacell.cell.fields import Frozen, GeometryDocument, first_mistake
from hexacell.config.layout import ConfigLayout, Contents, fingerprint_of, names_of, read_contents
from hexacell.errors import FileError
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionChange, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import JointUnit
from hexacell.storage import atomic_files


class JsonRecord(Frozen):
    """A record in a file of its own: written atomically, validated when read."""

    noun: ClassVar[str]
    """What error messages call it."""

    version: Literal[1] = 1

    def to_json(self) -> bytes:
        """The record as a JSON file's content."""
        return self.model_dump_json(indent=2).encode() + b"\n"

    def save(self, path: Path, like: Path | None = None) -> None:
        """Write the record atomically, for those who can read ``like``; raises ``FileError``."""
        atomic_files.write_own(path, self.to_json(), like=like)

    @classmethod
    def load(cls, path: Path) -> Self:
        """The record in a JSON file; raises ``FileError`` if there is none or it is damaged."""
        try:
            return cls.model_validate_json(atomic_files.read_bytes(path))
        except ValidationError as error:
            problem = f"this is not a {cls.noun}: {first_mistake(error, 'the file')}"
            raise FileError(problem, subject=path, action="Restore the file") from error


class FileChange(Frozen):
    """What a change puts into one further file of a config."""

    path: Path
    format: str
    text_before: str
    text_after: str


class ConfigChange(JsonRecord):
    """A new geometry for a controller, and the exact text that it puts into the config.

    It holds everything that a person reviews and everything that a commit needs. What is written is what
    was approved, even if the program restarts in between. ``joint_unit`` is that of the corrected backlash.
    """

    noun: ClassVar[str] = "config change"

    path: Path
    format: str
    before: GeometryDocument
    after: GeometryDocument
    sha256_before: str
    sha256_after: str
    text_before: str
    text_after: str
    further: tuple[FileChange, ...] = ()
    corrections_before: Corrections = NO_CORRECTIONS
    corrections_after: Corrections = NO_CORRECTIONS
    joint_unit: JointUnit = JointUnit.MM

    @model_validator(mode="after")
    def _texts_are_whole(self) -> Self:
        for name, contents, expected in (
            ("text_before", self.before_contents, self.sha256_before),
            ("text_after", self.after_contents, self.sha256_after),
        ):
            if fingerprint_of(contents) != expected:
                raise ValueError(f"{name} does not have the checksum stated for it")
        return self

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files of the config, the first one first."""
        return (self.path, *(one.path for one in self.further))

    def to_files(self, paths: Sequence[Path]) -> Self:
        """This change of other files, such as those of a machine's folder that was copied."""
        files = zip(self.further, paths[1:], strict=False)
        further = tuple(one.model_copy(update={"path": path.absolute()}) for one, path in files)
        return self.model_copy(update={"path": paths[0].absolute(), "further": further})

    @property
    def before_contents(self) -> Contents:
        """What the files held."""
        return (self.text_before.encode(), *(one.text_before.encode() for one in self.further))

    @property
    def after_contents(self) -> Contents:
        """What they are to hold."""
        return (self.text_after.encode(), *(one.text_after.encode() for one in self.further))

    @property
    def diff(self) -> str:
        """The exact change of the text, file by file."""
        return diff_of_files(self.paths, self.before_contents, self.after_contents)

    @property
    def changed_corrections(self) -> tuple[CorrectionChange, ...]:
        """The numbers of the corrections that it changes."""
        return self.corrections_before.changes_to(self.corrections_after, self.joint_unit)


def propose(
    paths: Sequence[Path],
    layout: ConfigLayout,
    after: Geometry,
    corrections: Corrections | None = None,
    *,
    fingerprint_at_start: str,
) -> ConfigChange:
    """The change that gives the controller the geometry ``after``, mm; nothing is written.

    Without ``corrections`` it keeps those that it has. ``fingerprint_at_start`` is the
    :func:`~hexacell.config.layout.fingerprint` of the config when the run began: the measurements were
    commanded with that geometry and are meaningless with another. Raises ``FileError`` if the config
    changed since, is invalid, or has no place for ``corrections``.
    """
    contents = read_contents(paths)
    require_fingerprint(paths[0], contents, fingerprint_at_start)
    before = layout.read(*paths)
    texts = [atomic_files.decode_utf8(data, path) for data, path in zip(contents, paths, strict=True)]
    new = layout.rewrite(texts, after, corrections)
    first, *further = (
        FileChange(path=path.absolute(), format=one.name, text_before=old, text_after=text)
        for path, one, old, text in zip(paths, layout.formats, texts, new, strict=True)
    )
    return ConfigChange(
        **first.model_dump(),
        before=before.geometry.document(),
        after=after.document(),
        sha256_before=fingerprint_at_start,
        sha256_after=fingerprint_of(tuple(text.encode() for text in new)),
        further=tuple(further),
        corrections_before=before.corrections,
        corrections_after=before.corrections if corrections is None else corrections,
        joint_unit=layout.joint_unit,
    )


def require_fingerprint(path: Path, contents: Contents, expected: str) -> None:
    """Raise ``FileError`` if the config, whose first file is ``path``, changed since the run began."""
    if fingerprint_of(contents) != expected:
        raise FileError(
            "the config changed since the run began; the new geometry does not belong to it",
            subject=path,
            action="Nothing was written: undo the edit and retry, or run again",
        )


def diff_of_files(paths: Sequence[Path], before: Contents, after: Contents) -> str:
    """The text change as a unified diff, each of several files under its name; empty if there is none."""
    texts = [[data.decode(errors="replace") for data in contents] for contents in (before, after)]
    if len(paths) == 1:
        return diff(texts[0][0], texts[1][0])
    named = zip(names_of(paths), *texts, strict=True)
    return "".join(diff(old, new, (name, name)) for name, old, new in named)


def diff(before: str, after: str, names: tuple[str, str] = ("config-before", "config-after")) -> str:
    """The text change as a unified diff that ``patch`` accepts; empty if there is none."""
    lines = difflib.unified_diff(_lines(before), _lines(after), *names)
    return "".join(one if one.endswith("\n") else f"{one}\n\\ No newline at end of file\n" for one in lines)


def _lines(text: str) -> list[str]:
    # str.splitlines also splits at form feeds and other characters that do not end a line in a file.
    return list(io.StringIO(text, newline="\n"))


BEFORE = "config-before"
AFTER = "config-after"
RECEIPT = "write-back.json"


def kept_paths(folder: Path, name: str, count: int) -> tuple[Path, ...]:
    """Where a folder keeps so many files of a config; ``name`` is ``BEFORE`` or ``AFTER``."""
    return (folder / name, *(folder / f"{name}-{number}" for number in range(2, count + 1)))


class Receipt(JsonRecord):
    """What a commit did, and where the backup is.

    ``further`` are the files of the config beside ``path``; ``backup_folder`` is where the receipt was
    written, or found: a run folder may be moved.
    """

    noun: ClassVar[str] = "receipt of a write-back"

    path: Path
    format: str
    sha256_before: str
    sha256_after: str
    backup_folder: Path
    further: tuple[Path, ...] = ()

    @classmethod
    def of(cls, folder: Path) -> "Receipt":
        """The receipt kept in a run folder; raises ``FileError``.

        Where folder and config were copied or moved together, it is of the config that is beside it now.
        """
        found, here = cls.load(folder / RECEIPT), folder.absolute()
        if found.backup_folder == here:
            return found
        way = [os.path.relpath(one, found.backup_folder) for one in found.paths]
        with atomic_files.os_errors("cannot be read", folder):
            moved = [Path(os.path.normpath(here / one)) for one in way]
            first, *further = moved if all(one.is_file() for one in moved) else found.paths
        return found.model_copy(update={"path": first, "further": tuple(further), "backup_folder": here})

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
