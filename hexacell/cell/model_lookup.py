"""What the model of the cell file says about a place in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

from hexacell.cell.fields import Section
from hexacell.storage.toml_document import table_header
from hexacell.storage.toml_locations import KeyPath


@dataclass(frozen=True, slots=True)
class ModelLookup:
    """Places in the cell file by their paths; ``model`` is that of the whole file."""

    model: type[Section]

    def section_at(self, path: KeyPath) -> type[Section] | None:
        """The model of the section at ``path``; None if no section belongs there."""
        annotation = self._annotation_at(path)
        return annotation if isinstance(annotation, type) and issubclass(annotation, Section) else None

    def length_at(self, path: KeyPath) -> int | None:
        """The length of the list at ``path``; None if any length is allowed or no list belongs there."""
        annotation = self._annotation_at(path)
        items = get_args(annotation) if get_origin(annotation) is tuple else ()
        return len(items) if items and items[-1] is not Ellipsis else None

    def description_at(self, path: KeyPath) -> str | None:
        """The description of the key at ``path``, or of the key whose list contains ``path``."""
        while path and not isinstance(path[-1], str):
            path = path[:-1]
        section = self.section_at(path[:-1]) if path else None
        field = section.model_fields.get(str(path[-1])) if section else None
        return field.description if field else None

    def header(self, path: KeyPath) -> str:
        """The header that opens the section at ``path``: ``[robot.nominal]``, ``[[gauges]]``."""
        return table_header((*path, 0) if self.section_at((*path, 0)) else path)

    def sections_with(self, key: str) -> list[str]:
        """The headers of the sections that have ``key``."""
        found = self._sections(self.model, ())
        return [self.header(path) for path, section in found if key in section.model_fields]

    def _annotation_at(self, path: KeyPath) -> object:
        annotation: object = self.model
        for key in path:
            annotation = _without_none(_inside(annotation, key))
        return annotation

    def _sections(self, section: type[Section], path: KeyPath) -> Iterator[tuple[KeyPath, type[Section]]]:
        for name in section.model_fields:
            for inner in ((*path, name), (*path, name, 0)):
                if found := self.section_at(inner):
                    yield inner, found
                    yield from self._sections(found, inner)


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
