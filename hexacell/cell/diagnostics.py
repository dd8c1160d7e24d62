"""What is wrong with a cell file, in the words of its reader and with the line.

The model refuses with pydantic's errors, which speak of types and validators. Here each becomes
one sentence that says what stands in the file, what must stand there, and what to do.

What may stand where in a cell file, as its model says, and what a person probably meant.

On which line of a cell file a value stands.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import ValidationError

from hexacell.cell.fields import Section
from hexacell.cell.model import CellSettings
from hexacell.errors import FileError
from hexacell.storage import toml_locations
from hexacell.storage.toml_locations import KeyPath

LONGEST_QUOTE = 40
_EXPECTED = {
    "string_type": "text in quotes",
    "string_too_short": "text that is not empty",
    "int_type": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "tuple_type": "a list in square brackets",
    "dict_type": "a table: {{ key = value }}",
    "model_type": "a section",
    "literal_error": "{expected}",
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "{ge:g} or more",
    "less_than": "less than {lt:g}",
    "less_than_equal": "{le:g} or less",
    "too_short": "a list of {min_length} items or more",
}


@dataclass(frozen=True)
class Document:
    """A cell file taken apart: where it is, what it says, the same as JSON, and on which lines."""

    path: Path
    data: Mapping[str, Any]
    json: str
    lines: Mapping[KeyPath, int]

    def value(self, path: KeyPath) -> object:
        """What the file says at ``path``."""
        found: Any = self.data
        for key in path:
            found = found[key]
        return found

    def error(self, path: KeyPath, problem: str, action: str) -> FileError:
        """A problem at ``path``, with its line."""
        return FileError(problem, subject=self.path, line=line_of(self.lines, path), action=action)


Errors = dict[KeyPath, FileError]


def foreign_values(document: Document) -> Errors:
    """Values that TOML can write but no cell file holds: NaN, infinities, dates and times."""
    errors: Errors = {}
    for path, value in _leaves((), document.data):
        if isinstance(value, float) and not math.isfinite(value):
            errors[path] = _unfit(document, path, "a finite number")
        elif not isinstance(value, str | int | float):
            errors[path] = _unfit(document, path, "a number or text in quotes")
    return errors


def explained(document: Document, refusal: ValidationError) -> Errors:
    """One error for every place that the model refuses."""
    errors: Errors = {}
    for detail in refusal.errors(include_url=False):
        path, kind = detail["loc"], detail["type"]
        if kind == "missing" and isinstance(path[-1], int):
            path, kind = path[:-1], "too_few"
        context = {"problem": detail["msg"], "action": "Correct it", **detail.get("ctx", {})}
        errors.setdefault(path, _explain(document, path, kind, context))
    return errors


def _leaves(path: KeyPath, value: object) -> Iterator[tuple[KeyPath, object]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves((*path, key), inner)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _leaves((*path, number), inner)
    else:
        yield path, value


def _explain(document: Document, path: KeyPath, kind: str, context: Mapping[str, Any]) -> FileError:
    length = length_at(path)
    if length is not None and kind in {"too_few", "too_long", "tuple_type"}:
        return _unfit(document, path, _list_of(length, path))
    if kind == "missing":
        return _missing(document, path)
    if kind == "extra_forbidden":
        return _unknown(document, path)
    if kind in _EXPECTED:
        return _unfit(document, path, _EXPECTED[kind].format(**context))
    if kind == "json_invalid":
        return document.error((), "brackets are nested too deeply", "Remove those that are not needed")
    return document.error(path, context["problem"], context["action"])


def _missing(document: Document, path: KeyPath) -> FileError:
    if section := section_at(path) or section_at((*path, 0)):
        keys = [name for name, field in section.model_fields.items() if field.is_required()]
        action = f"Add it, with {', '.join(keys)}" if keys else "Add it"
        return document.error(path, f"the section {header(path)} is missing", action)
    meaning = description_at(path)
    action = f"Add {path[-1]} = ..." + (f" ({meaning})" if meaning else "")
    return document.error(path, f"{_named(path)} is missing", action)


def _unknown(document: Document, path: KeyPath) -> FileError:
    parent = section_at(path[:-1])
    known = list(parent.model_fields) if parent else []
    kind = "section" if isinstance(document.value(path), dict) else "key"
    if likely := nearest(str(path[-1]), known):
        action = f"Did you mean '{likely}'?"
    elif homes := sections_with(str(path[-1])):
        action = f"It belongs in {' or '.join(homes)}"
    else:
        action = f"Known here: {', '.join(known)}"
    return document.error(path, f"unknown {kind} {_named(path)}", action)


def _unfit(document: Document, path: KeyPath, expected: str) -> FileError:
    value = document.value(path)
    problem = f"{_named(path)} is {_found(value)}, but must be {expected}"
    meaning = description_at(path)
    action = "Remove the quotes" if _is_quoted_number(value, expected) else "Correct it"
    return document.error(path, problem, action + (f" ({meaning})" if meaning else ""))


def _is_quoted_number(value: object, expected: str) -> bool:
    return isinstance(value, str) and "number" in expected and value.strip("+-").replace(".", "").isdigit()


def _list_of(length: int, path: KeyPath) -> str:
    if section_at((*path, 0)):
        return f"{length} sections, each beginning with {header(path)}"
    return f"a list of {length} items"


def _found(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'the text "{_cut(value)}"'
        case int() | float():
            return _cut(repr(value))
        case list():
            return f"a list of {len(value)} item{'' if len(value) == 1 else 's'}"
        case dict():
            return "a section"
        case _:
            return "a date or a time"


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."


def _named(path: KeyPath) -> str:
    """A place as a person finds it: ``'S' in [robot.nominal], row 4, number 2``."""
    last = max(place for place, key in enumerate(path) if isinstance(key, str))
    words = f"'{path[last]}' {_section_words(path[:last])}"
    for place in range(last + 1, len(path)):
        item = "row" if length_at(path[: place + 1]) else "number"
        words += f", {item} {int(path[place]) + 1}"
    return words


def _section_words(path: KeyPath) -> str:
    if not path:
        return "at the top of the file"
    numbers = [f" number {key + 1}" for key in path if isinstance(key, int)]
    return f"in {header(path)}{''.join(numbers)}"


def section_at(path: KeyPath) -> type[Section] | None:
    """The model of the section at ``path``, or none if no section belongs there."""
    annotation = _annotation_at(path)
    return annotation if isinstance(annotation, type) and issubclass(annotation, Section) else None


def length_at(path: KeyPath) -> int | None:
    """How many items the list at ``path`` has, or none if that is open or no list belongs there."""
    annotation = _annotation_at(path)
    items = get_args(annotation) if get_origin(annotation) is tuple else ()
    return len(items) if items and items[-1] is not Ellipsis else None


def description_at(path: KeyPath) -> str | None:
    """What the model says about the key that ``path`` leads to or into."""
    while path and not isinstance(path[-1], str):
        path = path[:-1]
    section = section_at(path[:-1]) if path else None
    field = section.model_fields.get(str(path[-1])) if section else None
    return field.description if field else None


def header(path: KeyPath) -> str:
    """The header that opens the section at ``path``: ``[robot.nominal]``, ``[[gauges]]``."""
    names = ".".join(key for key in path if isinstance(key, str))
    of_array = isinstance(path[-1], int) or section_at((*path, 0)) is not None
    return f"[[{names}]]" if of_array else f"[{names}]"


def sections_with(key: str) -> list[str]:
    """The headers of the sections that know ``key``."""
    return [header(path) for path, section in _sections(CellSettings, ()) if key in section.model_fields]


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The name most like ``word``, whatever its case; none if nothing is like it."""
    by_lower_case = {name.lower(): name for name in known}
    found = difflib.get_close_matches(word.lower(), by_lower_case, n=1)
    return by_lower_case[found[0]] if found else None


def _annotation_at(path: KeyPath) -> object:
    annotation: object = CellSettings
    for key in path:
        annotation = _without_none(_inside(annotation, key))
    return annotation


def _inside(annotation: object, key: str | int) -> object:
    if isinstance(annotation, type) and issubclass(annotation, Section):
        field = annotation.model_fields.get(str(key))
        return field.annotation if field else None
    return get_args(annotation)[0] if get_origin(annotation) is tuple else None


def _without_none(annotation: object) -> object:
    """A type without the ``| None`` and the constraints around it."""
    if get_origin(annotation) is Annotated:
        return get_args(annotation)[0]
    if get_origin(annotation) in {Union, UnionType}:
        return next(option for option in get_args(annotation) if option is not type(None))
    return annotation


def _sections(section: type[Section], path: KeyPath) -> Iterator[tuple[KeyPath, type[Section]]]:
    for name in section.model_fields:
        for inner in ((*path, name), (*path, name, 0)):
            if found := section_at(inner):
                yield inner, found
                yield from _sections(found, inner)


def locate(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table, key and array element in valid TOML ``text``.

    A table stands where it is first mentioned: at its header or at a header below it.
    """
    spans = toml_locations.locate(text)
    return {path: toml_locations.line_of(text, span.start) for path, span in spans.items()}


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int | None:
    """The line of ``path`` or, where the file does not have it, of the nearest place around it."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return None
