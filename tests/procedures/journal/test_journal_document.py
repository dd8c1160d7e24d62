"""``docs/journal.md`` describes every event and every field of the journal, and no other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from datetime import datetime
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import pytest
from pydantic import BaseModel

from procedures.journal.journal import VERSION
from procedures.steps.events import Event

DOCUMENT = Path(__file__).parents[3] / "docs" / "journal.md"
EVENTS = get_args(get_args(Event)[0])
NUMBERS = re.compile(r"\bnumbers?\b")
QUOTED = re.compile(r"`[^`]*`")


@dataclass(frozen=True)
class Row:
    """A field as the document has it."""

    name: str
    type: str
    unit: str
    meaning: str


def sections() -> dict[str, list[Row]]:
    """The rows under each heading of the third level."""
    found: dict[str, list[Row]] = {}
    for part in re.split(r"^### ", DOCUMENT.read_text(), flags=re.MULTILINE)[1:]:
        heading, _, rest = part.partition("\n")
        cells = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", rest, re.MULTILINE)
        found[heading.strip("`")] = [Row(*(cell.strip() for cell in row)) for row in cells]
    return found


def models() -> dict[str, type[Any]]:
    """Every event by its kind, and every model within them by its name."""
    found: dict[str, type[Any]] = {event.model_fields["kind"].default: event for event in EVENTS}
    for event in EVENTS:
        for part in parts_of(event):
            found[heading_of(part)] = part
    return found


def fields_of(model: type[Any]) -> dict[str, Any]:
    """The types of a model's or a dataclass's fields."""
    if is_dataclass(model):
        return get_type_hints(model)
    return {name: field.annotation for name, field in model.model_fields.items()}


def is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation))


def parts_of(model: type[Any]) -> Iterator[type[Any]]:
    for annotation in fields_of(model).values():
        for part in models_in(annotation):
            yield part
            yield from parts_of(part)


def models_in(annotation: Any) -> Iterator[type[Any]]:
    if is_model(annotation):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)


def kind_of(model: type[Any]) -> str | None:
    """The word that says which event it is, where it is one of several."""
    kind = None if is_dataclass(model) else model.model_fields.get("kind")
    return kind.default if kind is not None and type(kind.default) is str else None


def heading_of(model: type[Any]) -> str:
    """Its kind where it has one of its own, else its name."""
    return kind_of(model) or model.__name__


def words(annotation: Any) -> str:  # noqa: PLR0911 - a case a kind of type
    """A type as the document names it."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return words(arguments[0])
    if origin in {Union, UnionType}:
        options = [words(one) for one in arguments if one is not NoneType]
        return " or ".join([*options, *(["null"] if NoneType in arguments else [])])
    if origin is Literal:
        return " or ".join(f"`{one}`" for one in arguments)
    if origin is tuple and not arguments:
        return "an empty list"
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"list of {words(arguments[0])}"
    if origin is tuple:
        return f"{len(arguments)} x {words(arguments[0])}"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f"`{one.value}`" for one in annotation)
    if is_model(annotation):
        return heading_of(annotation)
    plain = {
        float: "number",
        int: "whole number",
        str: "text",
        bool: "true or false",
        datetime: "time",
    }
    return plain.get(annotation, "object")


def required(model: type[Any]) -> list[tuple[str, str]]:
    """Name and type of every field; ``kind`` says which event it is and is left out."""
    fields = fields_of(model).items()
    return [
        (name, words(annotation)) for name, annotation in fields if name != "kind" or not kind_of(model)
    ]


def test_every_event_and_every_part_has_its_section() -> None:
    assert sorted(sections()) == sorted(models())


@pytest.mark.parametrize("heading", models())
def test_every_field_is_described_as_it_is(heading: str) -> None:
    rows = sections().get(heading, [])
    assert [(row.name, row.type) for row in rows] == required(models()[heading])
    for row in rows:
        assert row.meaning, f"{heading}: what is {row.name}?"
        assert bool(row.unit) == bool(NUMBERS.search(QUOTED.sub("", row.type))), (
            f"{heading}: the unit of {row.name}"
        )


def test_the_version_is_the_one_that_is_written() -> None:
    assert f"`version` is {VERSION}" in DOCUMENT.read_text()
