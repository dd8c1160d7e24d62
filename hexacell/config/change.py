"""A change of the controller's config, complete and reviewable."""

from __future__ import annotations

import difflib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Literal, Self

from pydantic import ValidationError, model_validator

from hexacell.cell.fields import Frozen, GeometryDocument, first_mistake
from hexacell.config.layout import ConfigLayout, Contents, fingerprint_of, names_of, read_contents
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
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
        atomic_files.write_atomically(path, self.to_json(), like=like)

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
    was approved, even if the program restarts in between.
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


def propose(
    paths: Sequence[Path], layout: ConfigLayout, after: Geometry, *, fingerprint_at_start: str
) -> ConfigChange:
    """The change that gives the controller the geometry ``after``, mm; nothing is written.

    ``fingerprint_at_start`` is the :func:`~hexacell.config.layout.fingerprint` of the config
    when the run began: the measurements were commanded with that geometry and are meaningless with another.

    Raises:
        FileError: the config changed since, or is invalid.
    """
    contents = read_contents(paths)
    require_fingerprint(paths[0], contents, fingerprint_at_start)
    before = layout.read(*paths).geometry
    texts = [atomic_files.decode_utf8(data, path) for data, path in zip(contents, paths, strict=True)]
    new = layout.rewrite(texts, after)
    first, *further = (
        FileChange(path=path.absolute(), format=one.name, text_before=old, text_after=text)
        for path, one, old, text in zip(paths, layout.formats, texts, new, strict=True)
    )
    return ConfigChange(
        path=first.path,
        format=first.format,
        before=before.document(),
        after=after.document(),
        sha256_before=fingerprint_at_start,
        sha256_after=fingerprint_of(tuple(text.encode() for text in new)),
        text_before=first.text_before,
        text_after=first.text_after,
        further=tuple(further),
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
    return "".join(
        line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines
    )


def _lines(text: str) -> list[str]:
    # str.splitlines also splits at form feeds and other characters that do not end a line in a file.
    return list(io.StringIO(text, newline="\n"))
