"""The sections of a cell file for mechanisms that do not have six joints.

The sections are written for six. Here those fields that have an item for each joint get as many as there
are joints, and their defaults, too; nothing else changes.
"""

import types
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BeforeValidator, create_model

from hexacell.cell.fields import OF_JOINTS, Section

SectionType = TypeVar("SectionType", bound=Section)


def for_joints(section: type[SectionType], count: int) -> type[SectionType]:
    """A section, and those in it, for so many joints; itself where it has nothing of each joint."""
    fields: dict[str, Any] = {}
    for name, written in section.model_fields.items():
        annotation, metadata = _sized(written.annotation, written.metadata, count)
        if annotation is written.annotation:
            continue
        field = copy(written)
        field.annotation, field.metadata = annotation, metadata
        field.default = _default(written.default, annotation, count)
        fields[name] = (annotation, field)
    if not fields:
        return section
    return create_model(section.__name__, __base__=section, __doc__=section.__doc__, **fields)


def _sized(annotation: Any, metadata: list[Any], count: int) -> tuple[Any, list[Any]]:  # noqa: ANN401
    """A type and what is said of it, for so many joints; the same objects where nothing changes."""
    if OF_JOINTS in metadata:
        return tuple.__class_getitem__(get_args(annotation)[:count]), [
            _counting(one, count) for one in metadata
        ]
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return for_joints(annotation, count), metadata
    parts = get_args(annotation)
    if get_origin(annotation) is Annotated:
        inner, further = _sized(parts[0], list(parts[1:]), count)
        return (annotation if inner is parts[0] else Annotated[inner, *further]), metadata
    if get_origin(annotation) in {Union, types.UnionType}:
        sized = [_sized(one, [], count)[0] for one in parts]
        is_same = all(new is old for new, old in zip(sized, parts, strict=True))
        counting = [_counting(one, count) for one in metadata]
        return (annotation, metadata) if is_same else (Union[tuple(sized)], counting)  # noqa: UP007
    return annotation, metadata


def _counting(said: Any, count: int) -> Any:  # noqa: ANN401
    """A validator that has to know how many joints there are, for so many."""
    if (
        isinstance(said, BeforeValidator)
        and isinstance(said.func, partial)
        and "count" in said.func.keywords
    ):
        return replace(said, func=partial(said.func.func, count=count))
    return said


def _default(written: Any, annotation: Any, count: int) -> Any:  # noqa: ANN401
    if isinstance(written, tuple):
        return written[:count]
    is_section = isinstance(written, Section) and isinstance(annotation, type)
    return annotation() if is_section else written
