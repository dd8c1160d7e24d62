"""``docs/journal.md`` says what the journal holds: every event and every field, and no other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pytest
from pydantic import BaseModel

from procedures.journal.line_format import VERSION
from procedures.run.events import Event

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


def models() -> dict[str, type[BaseModel]]:
    """Every event by its kind, and every model within them by its name."""
    found = {event.model_fields["kind"].default: event for event in EVENTS}
    for event in EVENTS:
        for part in parts_of(event):
            found[heading_of(part)] = part
    return found


def parts_of(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for field in model.model_fields.values():
        for part in models_in(field.annotation):
            yield part
            yield from parts_of(part)


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)


def heading_of(model: type[BaseModel]) -> str:
    """Its kind where it has one of its own, else its name."""
    kind = model.model_fields.get("kind")
    return kind.default if kind is not None and type(kind.default) is str else model.__name__


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
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"list of {words(arguments[0])}"
    if origin is tuple:
        return f"{len(arguments)} x {words(arguments[0])}"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f"`{one.value}`" for one in annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return heading_of(annotation)
    plain = {float: "number", int: "whole number", str: "text", bool: "true or false"}
    return plain.get(annotation, "object")


def required(model: type[BaseModel]) -> list[tuple[str, str]]:
    """Name and type of every field; ``kind`` says which event it is and is left out."""
    fields = model.model_fields.items()
    return [(name, words(field.annotation)) for name, field in fields if not is_kind(name, model)]


def is_kind(name: str, model: type[BaseModel]) -> bool:
    return name == "kind" and type(model.model_fields[name].default) is str


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
