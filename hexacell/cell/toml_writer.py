"""A cell's settings as the text of a cell file.

Every number is written in full, so that reading the text gives equal settings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import tomlkit

from hexacell.cell.fields import Section
from hexacell.storage.toml_document import table_header
from hexacell.storage.toml_locations import KeyPath

Remark = Callable[[KeyPath], str | None]
"""The comment behind the value at a path, if any."""


def to_toml(settings: Section, remark: Remark = lambda _: None) -> str:
    """The settings as TOML, defaults included; a value of None is left out."""
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
