"""A cell's settings as the text of a cell file.

Every number is written in full, so that reading the text gives equal settings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import tomlkit

from hexacell.cell.fields import Section
from hexacell.cell.model_lookup import header
from hexacell.storage.toml_locations import KeyPath

Remark = Callable[[KeyPath], str | None]
"""The comment behind the value at a path, if any."""


def to_toml(settings: Section, remark: Remark = lambda _: None) -> str:
    """The settings as TOML, defaults included; a value of None is left out."""
    return "\n".join(_section(settings, (), remark)).lstrip("\n") + "\n"


def subsections(path: KeyPath, value: object) -> list[tuple[KeyPath, Section]]:
    """The sections that the value at ``path`` is made of, each with its path; none if it is plain."""
    if isinstance(value, Section):
        return [(path, value)]
    items = value if isinstance(value, tuple) else ()
    return [((*path, n), item) for n, item in enumerate(items) if isinstance(item, Section)]


def _section(section: Section, path: KeyPath, remark: Remark) -> Iterator[str]:
    """The section's own values first: after the first header every key would belong to that."""
    for name, value in section:
        if not subsections((*path, name), value):
            yield from _setting(name, value, remark((*path, name)))
    for name, value in section:
        for inner, subsection in subsections((*path, name), value):
            yield from ("", header(inner))
            yield from _section(subsection, inner, remark)


def _setting(name: str, value: object, comment: str | None) -> list[str]:
    if value is None:
        return [f"# {name} is not set"] if comment else []
    return [f"{name} = {_value(value, rows=True)}" + (f"  # {comment}" if comment else "")]


def _value(value: object, *, rows: bool = False) -> str:
    match value:
        case bool():
            return str(value).lower()
        case int():
            return str(int(value))
        case float():
            return repr(float(value))
        case tuple() | list():
            return _list(value, rows=rows)
        case dict():
            pairs = (f"{_key(key)} = {_value(inner)}" for key, inner in value.items() if inner is not None)
            return "{" + ", ".join(pairs) + "}"
        case _:
            return tomlkit.item(value).as_string()


def _list(items: tuple[object, ...] | list[object], *, rows: bool) -> str:
    """A list on one line, or, ``rows`` asked for and lists in it, one of them a line."""
    if rows and items and all(isinstance(item, tuple) for item in items):
        return "[\n" + "".join(f"  {_value(item)},\n" for item in items) + "]"
    return "[" + ", ".join(_value(item) for item in items) + "]"


def _key(name: str) -> str:
    return tomlkit.key(name).as_string()
