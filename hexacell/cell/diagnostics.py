"""What is wrong with a cell file, in the words of its reader and with the line.

The model refuses a file with pydantic's errors, which name types and validators. Here each becomes one
sentence: what is in the file, what must be there, and what to do.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import ValidationError

from hexacell.cell.fields import Section
from hexacell.errors import FileError, did_you_mean
from hexacell.storage.toml_document import KeyPath, TomlDocument, table_header


def _inside(annotation: object, key: str | int) -> object:
    if isinstance(annotation, type) and issubclass(annotation, Section):
        field = annotation.field_of(str(key))
        return field.annotation if field else None
    return get_args(annotation)[0] if get_origin(annotation) is tuple else None


def _without_none(annotation: object) -> object:
    """A type without the ``| None`` and the constraints around it."""
    if get_origin(annotation) is Annotated:
        return get_args(annotation)[0]
    if get_origin(annotation) in {Union, UnionType}:
        options = (option for option in get_args(annotation) if option is not type(None))
        return _without_none(next(options))
    return annotation


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
    "out_of_range": "{expected}",
    "string_too_long": "text of {max_length} letters or fewer",
    "int_parsing_size": "a whole number with fewer digits",
    "greater_than": "more than {gt:.12g}",
    "greater_than_equal": "{ge:.12g} or more",
    "less_than": "less than {lt:.12g}",
    "less_than_equal": "{le:.12g} or less",
    "too_long": "a list of {max_length} items or fewer",
    "too_short": "a list of {min_length} items or more",
}

Errors = dict[KeyPath, FileError]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What is wrong with a document by the model of the cell file; at most ``limit`` mistakes of a kind."""

    document: TomlDocument
    model: type[Section]
    limit: int

    def unsupported_values(self) -> Errors:
        """Values that TOML allows and a cell file does not: NaN, infinities, dates and times."""
        errors: Errors = {}
        for path in self.document.spans:
            if len(errors) == self.limit:
                break
            value = self.document.value(path)
            if isinstance(value, float) and not math.isfinite(value):
                errors[path] = self._mismatch(path, "a finite number")
            elif not isinstance(value, str | int | float | list | dict):
                errors[path] = self._mismatch(path, "a number or text in quotes")
        return errors

    def explain_refusal(self, refusal: ValidationError) -> Errors:
        """One error for every place that the model refuses."""
        errors: Errors = {}
        for detail in refusal.errors(include_url=False)[: self.limit]:
            path, kind = detail["loc"], detail["type"]
            if kind == "missing" and isinstance(path[-1], int):
                path, kind = path[:-1], "too_few"
            context = {"problem": detail["msg"], "action": "Correct it", **detail.get("ctx", {})}
            errors.setdefault(path, self._explain_one(path, kind, context))
        return errors

    def _explain_one(self, path: KeyPath, kind: str, context: Mapping[str, Any]) -> FileError:
        annotation = self._annotation_at(path)
        items = get_args(annotation) if get_origin(annotation) is tuple else ()
        length = len(items) if items and items[-1] is not Ellipsis else None
        if length is not None and kind in {"too_few", "too_long", "tuple_type"}:
            is_of_sections = self._section_at((*path, 0)) is not None
            each = f"sections, each beginning with {self._header(path)}"
            expected = f"{length} {each}" if is_of_sections else f"a list of {length} items"
            return self._mismatch(path, expected)
        if kind == "missing":
            return self._missing(path)
        if kind == "extra_forbidden":
            return self._unknown(path)
        if kind in _EXPECTED:
            return self._mismatch(path, _EXPECTED[kind].format(**context))
        if kind == "json_invalid":
            return self.document.error(
                (), "brackets are nested too deeply", "Remove those that are not needed"
            )
        return self.document.error(path, context["problem"], context["action"])

    def _missing(self, path: KeyPath) -> FileError:
        if section := self._section_at(path) or self._section_at((*path, 0)):
            keys = [section.key(name) for name, one in section.model_fields.items() if one.is_required()]
            action = f"Add it, with {', '.join(keys)}" if keys else "Add it"
            return self.document.error(path, f"the section {self._header(path)} is missing", action)
        meaning = self._description_at(path)
        action = f"Add {path[-1]} = ..." + (f" ({meaning})" if meaning else "")
        return self.document.error(path, f"{self.document.place(path)} is missing", action)

    def _unknown(self, path: KeyPath) -> FileError:
        parent = self._section_at(path[:-1])
        known = list(map(parent.key, parent.model_fields)) if parent else []
        kind = "section" if isinstance(self.document.value(path), dict) else "key"
        action = f"Known here: {', '.join(known)}"
        every = self._sections(self.model, ())
        if homes := [self._header(at) for at, section in every if section.field_of(str(path[-1]))]:
            action = f"It belongs in {' or '.join(homes)}"
        return self.document.error(
            path,
            f"unknown {kind} {self.document.place(path)}",
            did_you_mean(str(path[-1]), known) or action,
        )

    def _mismatch(self, path: KeyPath, expected: str) -> FileError:
        meaning = self._description_at(path)
        value, action = self.document.value(path), "Correct it"
        is_number = isinstance(value, str) and value.strip("+-").replace(".", "").isdigit()
        if is_number and "number" in expected:
            action = "Remove the quotes"
        return self.document.error(
            path, self.document.mismatch(path, expected), action + (f" ({meaning})" if meaning else "")
        )

    def _section_at(self, path: KeyPath) -> type[Section] | None:
        """The model of the section at ``path``; None if no section belongs there."""
        annotation = self._annotation_at(path)
        return annotation if isinstance(annotation, type) and issubclass(annotation, Section) else None

    def _description_at(self, path: KeyPath) -> str | None:
        """The description of the key at ``path``, or of the key whose list contains ``path``."""
        while path and not isinstance(path[-1], str):
            path = path[:-1]
        section = self._section_at(path[:-1]) if path else None
        field = section.field_of(str(path[-1])) if section else None
        return field.description if field else None

    def _header(self, path: KeyPath) -> str:
        """The header that opens the section at ``path``: ``[robot.nominal]``, ``[[gauges]]``."""
        return table_header((*path, 0) if self._section_at((*path, 0)) else path)

    def _annotation_at(self, path: KeyPath) -> object:
        annotation: object = self.model
        for key in path:
            annotation = _without_none(_inside(annotation, key))
        return annotation

    def _sections(self, section: type[Section], path: KeyPath) -> Iterator[tuple[KeyPath, type[Section]]]:
        for name in map(section.key, section.model_fields):
            for inner in ((*path, name), (*path, name, 0)):
                if found := self._section_at(inner):
                    yield inner, found
                    yield from self._sections(found, inner)
