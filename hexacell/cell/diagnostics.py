"""What is wrong with a cell file, in the words of its reader and with the line.

The model refuses a file with pydantic's errors, which name types and validators. Here each becomes one
sentence: what the file says, what it must say, and what to do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from hexacell.cell.model_lookup import description_at, header, length_at, section_at, sections_with
from hexacell.errors import FileError, did_you_mean
from hexacell.storage.toml_document import TomlDocument
from hexacell.storage.toml_locations import KeyPath

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

Errors = dict[KeyPath, FileError]


def unsupported_values(document: TomlDocument) -> Errors:
    """Values that TOML allows and a cell file does not: NaN, infinities, dates and times."""
    errors: Errors = {}
    for path in document.lines:
        value = document.value(path)
        if isinstance(value, float) and not math.isfinite(value):
            errors[path] = _mismatch(document, path, "a finite number")
        elif not isinstance(value, str | int | float | list | dict):
            errors[path] = _mismatch(document, path, "a number or text in quotes")
    return errors


def explain_refusal(document: TomlDocument, refusal: ValidationError) -> Errors:
    """One error for every place that the model refuses."""
    errors: Errors = {}
    for detail in refusal.errors(include_url=False):
        path, kind = detail["loc"], detail["type"]
        if kind == "missing" and isinstance(path[-1], int):
            path, kind = path[:-1], "too_few"
        context = {"problem": detail["msg"], "action": "Correct it", **detail.get("ctx", {})}
        errors.setdefault(path, _explain_one(document, path, kind, context))
    return errors


def _explain_one(document: TomlDocument, path: KeyPath, kind: str, context: Mapping[str, Any]) -> FileError:
    length = length_at(path)
    if length is not None and kind in {"too_few", "too_long", "tuple_type"}:
        return _mismatch(document, path, _list_of(length, path))
    if kind == "missing":
        return _missing(document, path)
    if kind == "extra_forbidden":
        return _unknown(document, path)
    if kind in _EXPECTED:
        return _mismatch(document, path, _EXPECTED[kind].format(**context))
    if kind == "json_invalid":
        return document.error((), "brackets are nested too deeply", "Remove those that are not needed")
    return document.error(path, context["problem"], context["action"])


def _missing(document: TomlDocument, path: KeyPath) -> FileError:
    if section := section_at(path) or section_at((*path, 0)):
        keys = [name for name, field in section.model_fields.items() if field.is_required()]
        action = f"Add it, with {', '.join(keys)}" if keys else "Add it"
        return document.error(path, f"the section {header(path)} is missing", action)
    meaning = description_at(path)
    action = f"Add {path[-1]} = ..." + (f" ({meaning})" if meaning else "")
    return document.error(path, f"{document.place(path)} is missing", action)


def _unknown(document: TomlDocument, path: KeyPath) -> FileError:
    parent = section_at(path[:-1])
    known = list(parent.model_fields) if parent else []
    kind = "section" if isinstance(document.value(path), dict) else "key"
    action = f"Known here: {', '.join(known)}"
    if homes := sections_with(str(path[-1])):
        action = f"It belongs in {' or '.join(homes)}"
    return document.error(
        path, f"unknown {kind} {document.place(path)}", did_you_mean(str(path[-1]), known) or action
    )


def _mismatch(document: TomlDocument, path: KeyPath, expected: str) -> FileError:
    meaning = description_at(path)
    action = "Remove the quotes" if _is_quoted_number(document.value(path), expected) else "Correct it"
    return document.error(
        path, document.mismatch(path, expected), action + (f" ({meaning})" if meaning else "")
    )


def _is_quoted_number(value: object, expected: str) -> bool:
    return isinstance(value, str) and "number" in expected and value.strip("+-").replace(".", "").isdigit()


def _list_of(length: int, path: KeyPath) -> str:
    if section_at((*path, 0)):
        return f"{length} sections, each beginning with {header(path)}"
    return f"a list of {length} items"
