"""The cell file: read, checked, shown, and written.

What may stand in it is the model in :mod:`hexacell.cell.model`; here is how its text becomes
settings, with the line of every value and an error that a technician can act on.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hexacell.cell.diagnostics import Document, Errors, explained, foreign_values, locate
from hexacell.cell.fields import Section
from hexacell.cell.model import CellSettings
from hexacell.cell.toml_writer import subsections, to_toml
from hexacell.errors import FileError, SeveralErrors
from hexacell.storage.atomic_files import read_text
from hexacell.storage.toml_locations import BYTE_ORDER_MARK, KeyPath


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a setting comes from: a line of the cell file, or the program's default (no line)."""

    line: int | None = None

    def __str__(self) -> str:
        return "default" if self.line is None else f"line {self.line}"


@dataclass(frozen=True)
class Cell:
    """A cell file as read.

    ``provenance`` has every setting under its dotted key, ``limits.tilt_deg`` or
    ``gauges[2].port``, sections in a list counted from 1.
    """

    path: Path
    settings: CellSettings
    text: str
    provenance: Mapping[str, Origin]

    @property
    def config_path(self) -> Path:
        """The controller's config; its name in the cell file is relative to the cell file."""
        return self.path.parent / self.settings.controller.config


def load_cell(path: Path) -> Cell:
    """Read and check a cell file.

    Raises:
        FileError: The file cannot be read, is no TOML, or has one mistake.
        SeveralErrors: It has more than one; each of ``errors`` is a FileError with its line.
    """
    text = read_text(path).removeprefix(BYTE_ORDER_MARK)
    document = _parsed(path, text)
    settings = _checked(document)
    origins = {dotted(key): Origin(document.lines.get(key)) for key in _keys(settings, ())}
    return Cell(path, settings, text, origins)


def describe(cell: Cell) -> str:
    """The cell file with every default filled in, each value marked with where it comes from.

    The text is itself a cell file with equal settings.
    """
    return to_toml(cell.settings, lambda key: str(cell.provenance[dotted(key)]))


def dump(settings: CellSettings) -> str:
    """The text of a cell file with these settings, exactly."""
    return to_toml(settings)


def schema() -> dict[str, Any]:
    """The JSON Schema of a cell file, for editors and for other programs."""
    return CellSettings.model_json_schema()


def dotted(path: KeyPath) -> str:
    """A path as a dotted key: ``gauges[2].port``, counted from 1."""
    return "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in path).removeprefix(".")


def _keys(section: Section, path: KeyPath) -> Iterator[KeyPath]:
    """The paths of all settings, those in sections within ``section`` included."""
    for name, value in section:
        inner = subsections((*path, name), value)
        if not inner:
            yield (*path, name)
        for key, subsection in inner:
            yield from _keys(subsection, key)


def _parsed(path: Path, text: str) -> Document:
    try:
        data = tomllib.loads(text)
        return Document(path, data, json.dumps(data, default=str), locate(text))
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(path, text, str(error)) from None
    except RecursionError:
        raise FileError("brackets are nested too deeply", subject=path, action="Remove some") from None
    except ValueError:
        # Python refuses to read or write integers of thousands of digits, without saying where.
        raise FileError("has a number of too many digits", subject=path, action="Shorten it") from None


_POSITION = re.compile(r" \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)$")


def _not_toml(path: Path, text: str, message: str) -> FileError:
    position = _POSITION.search(message)
    line = int(position["line"]) if position and position["line"] else len(text.splitlines())
    words = _POSITION.sub("", message)
    # "Cannot overwrite a value", "Cannot declare ('gauges',) twice" and their like.
    words = "a key or a section stands twice" if words.startswith("Cannot ") else words
    return FileError(f"is not valid TOML: {words}", subject=path, line=line, action="Correct this line")


def _checked(document: Document) -> CellSettings:
    errors: Errors = foreign_values(document)
    try:
        # As JSON, since strict checking then still takes arrays for tuples.
        settings = CellSettings.model_validate_json(document.json, strict=True)
    except ValidationError as refusal:
        errors |= explained(document, refusal)
    if errors:
        raise _together(document.path, list(errors.values()))
    return settings


def _together(path: Path, errors: list[FileError]) -> FileError | SeveralErrors:
    if len(errors) == 1:
        return errors[0]
    in_order = sorted(errors, key=lambda error: error.line or 0)
    return SeveralErrors(f"{path} has {len(errors)} mistakes", [*in_order])
