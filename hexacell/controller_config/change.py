"""A change of the controller's config, complete and reviewable."""

from __future__ import annotations

import difflib
import io
from pathlib import Path
from typing import ClassVar, Literal, Self

from pydantic import ValidationError, model_validator

from hexacell.cell.fields import Frozen, GeometryDocument, first_mistake
from hexacell.controller_config.interface import ConfigFormat
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

    @model_validator(mode="after")
    def _texts_are_whole(self) -> Self:
        for name, text, expected in (
            ("text_before", self.text_before, self.sha256_before),
            ("text_after", self.text_after, self.sha256_after),
        ):
            if atomic_files.sha256(text.encode()) != expected:
                raise ValueError(f"{name} does not have the checksum stated for it")
        return self

    @property
    def diff(self) -> str:
        """The exact change of the text."""
        return diff(self.text_before, self.text_after)


def fingerprint(path: Path) -> str:
    """The SHA-256 of a config, for the start of a run; raises ``FileError``."""
    return atomic_files.sha256(atomic_files.read_bytes(path))


def propose(
    path: Path, config_format: ConfigFormat, format_name: str, after: Geometry, *, fingerprint_at_start: str
) -> ConfigChange:
    """The change that gives the controller the geometry ``after``, mm; nothing is written.

    ``format_name`` is the name of ``config_format`` in the cell file, ``fingerprint_at_start`` the
    :func:`fingerprint` of the config when the run began: the measurements were commanded with that
    geometry and are meaningless with another one.

    Raises:
        FileError: the config changed since, or is invalid.
    """
    data = atomic_files.read_bytes(path)
    require_fingerprint(path, data, fingerprint_at_start)
    before = config_format.read(path).geometry
    text_before = atomic_files.decode_utf8(data, path)
    text_after = config_format.rewrite(text_before, after)
    return ConfigChange(
        path=path.absolute(),
        format=format_name,
        before=before.document(),
        after=after.document(),
        sha256_before=fingerprint_at_start,
        sha256_after=atomic_files.sha256(text_after.encode()),
        text_before=text_before,
        text_after=text_after,
    )


def require_fingerprint(path: Path, data: bytes, expected: str) -> None:
    """Raise ``FileError`` if ``data``, the content of ``path``, changed since the run began."""
    if atomic_files.sha256(data) != expected:
        raise FileError(
            "the config changed since the run began; the new geometry does not belong to it",
            subject=path,
            action="Nothing was written: undo the edit and retry, or run again",
        )


def diff(before: str, after: str) -> str:
    """The text change as a unified diff that ``patch`` accepts; empty if there is none."""
    lines = difflib.unified_diff(_lines(before), _lines(after), "config-before", "config-after")
    return "".join(
        line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines
    )


def _lines(text: str) -> list[str]:
    # str.splitlines also splits at form feeds and other characters that do not end a line in a file.
    return list(io.StringIO(text, newline="\n"))
