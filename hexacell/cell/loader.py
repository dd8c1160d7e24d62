"""The cell file: read, checked, described and written.

:mod:`hexacell.cell.model` says what a cell file may hold. Here its text becomes settings, with the line of
every value and errors that a technician can act on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from hexacell.cell.diagnostics import Diagnosis, ModelLookup
from hexacell.cell.fields import Section
from hexacell.cell.mechanism_sections import DEFAULT_MECHANISM
from hexacell.cell.model import CellSettings, cell_model
from hexacell.errors import FileError, SeveralErrors
from hexacell.plugins import Group, names
from hexacell.storage.atomic_files import read_text
from hexacell.storage.toml_document import BYTE_ORDER_MARK, TomlDocument, table_header
from hexacell.storage.toml_locations import KeyPath

Remark = Callable[[KeyPath], str | None]
"""The comment behind the value at a path, if any."""


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
    document = TomlDocument.parse(text, path)
    settings = _checked(document, path)
    origins = {dotted(key): Origin(document.lines.get(key)) for key in _keys(settings, ())}
    return Cell(path, settings, text, origins)


def describe(cell: Cell) -> str:
    """The cell file with every default filled in, each value marked with where it comes from.

    The text is itself a cell file with equal settings.
    """
    return dump(cell.settings, lambda key: str(cell.provenance[dotted(key)]))


def schema() -> dict[str, Any]:
    """The JSON Schema of a cell file, for editors and for other programs."""
    return cell_model(DEFAULT_MECHANISM).model_json_schema()


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


def _checked(document: TomlDocument, path: Path) -> CellSettings:
    model = cell_model(_mechanism(document))
    diagnosis = Diagnosis(document, ModelLookup(model))
    errors = diagnosis.unsupported_values()
    try:
        # As JSON, because strict validation then accepts arrays as tuples.
        settings = model.model_validate_json(document.to_json(), strict=True)
    except ValidationError as refusal:
        errors |= diagnosis.explain_refusal(refusal)
    if errors:
        raise _joined(path, list(errors.values()))
    return settings


def _mechanism(document: TomlDocument) -> str:
    """The mechanism that the file names. One that is not installed is refused when the robot is made."""
    robot = document.data.get("robot")
    name = robot.get("mechanism") if isinstance(robot, dict) else None
    return name if isinstance(name, str) and name in names(Group.MECHANISMS) else DEFAULT_MECHANISM


def _joined(path: Path, errors: list[FileError]) -> FileError | SeveralErrors:
    if len(errors) == 1:
        return errors[0]
    in_order = sorted(errors, key=lambda error: error.line or 0)
    return SeveralErrors(f"{path} has {len(errors)} mistakes", [*in_order])


def dump(settings: Section, remark: Remark = lambda _: None) -> str:
    """The settings as TOML, defaults included, each number in full; a value of None is left out."""
    return "\n".join(_section(settings, (), remark)).lstrip("\n") + "\n"


def subsections(path: KeyPath, value: object) -> list[tuple[KeyPath, Section]]:
    """The sections in the value at ``path``, each with its path; none if it is a plain value."""
    if isinstance(value, Section):
        return [(path, value)]
    items = value if isinstance(value, tuple) else ()
    return [((*path, n), item) for n, item in enumerate(items) if isinstance(item, Section)]


def _section(section: Section, path: KeyPath, remark: Remark) -> Iterator[str]:
    """The section's own values first: after a header every key belongs to the section it opens."""
    for name, value in section:
        if not subsections((*path, name), value):
            yield from _setting(name, value, remark((*path, name)))
    for name, value in section:
        for inner, subsection in subsections((*path, name), value):
            yield from ("", table_header(inner))
            yield from _section(subsection, inner, remark)


def _setting(name: str, value: object, comment: str | None) -> list[str]:
    if value is None:
        return [f"# {name} is not set"] if comment else []
    return [f"{name} = {_value(value)}" + (f"  # {comment}" if comment else "")]


def _value(value: object) -> str:
    if isinstance(value, tuple) and value and all(isinstance(row, tuple) for row in value):
        return "[\n" + "".join(f"  {_value(row)},\n" for row in value) + "]"
    if isinstance(value, dict):
        table = tomlkit.inline_table()
        table.update(value)
        return table.as_string()
    return tomlkit.item(value).as_string()
