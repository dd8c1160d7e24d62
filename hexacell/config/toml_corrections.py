"""The table ``[corrections]`` of the native controller config, which may be absent.

    [corrections]
    backlash = [0.1, ...]               # six joints' lost motion, in their unit
    play_mm = [0.02, ...]               # six legs' difference of length between pull and push
    compliance_um_n = [0.3, ...]        # six legs'
    weight_n = 100.0                    # of the platform, whose forces the legs have
    weight_direction = [0.0, 0.0, -1.0] # in the base frame
    weight_centre_mm = [0.0, 0.0, 80.0] # in the platform frame; []: in the middle of the joints there

A key that is absent has its default. What is written are the numbers that change; a key that is absent is
added to the table, and a table that is absent at the end of the file.
"""

import re
from collections.abc import Mapping
from math import hypot
from typing import Annotated, TypeVar

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, ValidationError, field_validator

from hexacell.cell.diagnostics import Diagnosis
from hexacell.cell.fields import Direction, NotNegative, PointInRange, Section, Six
from hexacell.config.interface import (
    LARGEST_BACKLASH,
    LARGEST_COMPLIANCE_UM_N,
    LARGEST_PLAY_MM,
    write_number,
)
from hexacell.kinematics.corrections import Corrections, Three
from hexacell.storage.toml_document import KeyPath, TomlDocument

TABLE = "corrections"
REMARK = "# What the controller adds for what is not geometry: play, backlash, compliance under a weight."
DECIMALS, DECIMALS_OF_DIRECTION = 6, 9
MOST_MISTAKES = 20
"""Largest number of mistakes that are looked for; the first one is reported."""


def _of_unit_length(vector: Three) -> Three:
    length = hypot(*vector)
    x, y, z = (part / length for part in vector)
    return x, y, z


Backlash = Annotated[float, Field(ge=-LARGEST_BACKLASH, le=LARGEST_BACKLASH, allow_inf_nan=False)]
Play = Annotated[float, Field(ge=-LARGEST_PLAY_MM, le=LARGEST_PLAY_MM, allow_inf_nan=False)]
Compliance = Annotated[float, Field(ge=0.0, le=LARGEST_COMPLIANCE_UM_N, allow_inf_nan=False)]
Model = TypeVar("Model", bound=Section)

NO_NUMBERS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class OfOwner(Section):
    """A table of the robot's owner, which may have other keys beside these."""

    model_config = ConfigDict(extra="ignore")


class TomlCorrections(Section):
    """The table; its keys are the fields of :class:`.Corrections`."""

    backlash: Six[Backlash] = NO_NUMBERS
    play_mm: Six[Play] = NO_NUMBERS
    compliance_um_n: Six[Compliance] = NO_NUMBERS
    weight_n: NotNegative = 0.0
    weight_direction: Annotated[Direction, AfterValidator(_of_unit_length)] = (0.0, 0.0, -1.0)
    weight_centre_mm: PointInRange | None = None

    @field_validator("weight_centre_mm", mode="before")
    @classmethod
    def _none_is_an_empty_list(cls, given: object) -> object:
        return (tuple(given) or None) if isinstance(given, list) else given


class WithCorrections(OfOwner):
    """A config with this table, which may be absent."""

    corrections: TomlCorrections = TomlCorrections()


def validated(document: TomlDocument, model: type[Model]) -> Model:
    """The content of a document by a model; raises ``FileError`` with the line of the first mistake."""
    try:
        return model.model_validate_json(document.to_json(), strict=True)
    except ValidationError as refusal:
        errors = Diagnosis(document, model, MOST_MISTAKES).explain_refusal(refusal)
        raise min(errors.values(), key=lambda error: error.line or 0) from refusal


def with_corrections(text: str, corrections: Corrections) -> str:
    """``text`` with these corrections; raises ``FileError`` where it holds what is no correction."""
    document = TomlDocument.parse(text)
    before = validated(document, WithCorrections).corrections
    tokens, added = dict[KeyPath, str](), dict[str, str]()
    for key in TomlCorrections.model_fields:
        old, new = _numbers(before, key), _numbers(corrections, key)
        decimals = DECIMALS_OF_DIRECTION if key == "weight_direction" else DECIMALS
        half_of_last = 0.5 * 10.0**-decimals
        if len(old) == len(new) and np.allclose(old, new, rtol=0.0, atol=half_of_last):
            continue
        written = [write_number(value, decimals) for value in new]
        if (TABLE, key) not in document.spans:
            added[key] = f"[{', '.join(written)}]" if key != "weight_n" else written[0]
        elif key == "weight_n":
            tokens[TABLE, key] = written[0]
        elif len(old) != len(new) or key == "weight_direction":
            # A direction that is no unit vector in the text would change its meaning number by number.
            tokens[TABLE, key] = f"[{', '.join(written)}]"
        else:
            for place, token in enumerate(written):
                if abs(new[place] - old[place]) > half_of_last:
                    tokens[TABLE, key, place] = token
    return _with_keys(document.replaced(tokens), added)


def _numbers(corrections: Corrections | TomlCorrections, key: str) -> tuple[float, ...]:
    value = getattr(corrections, key)
    return () if value is None else tuple(value) if isinstance(value, tuple) else (value,)


def _with_keys(text: str, added: Mapping[str, str]) -> str:
    """``text`` with new keys behind those of the table, wherever that is."""
    if not added:
        return text
    document, end = TomlDocument.parse(text), "\r\n" if "\r\n" in text else "\n"
    lines = [f"{key} = {value}" for key, value in added.items()]
    if (table := document.spans.get((TABLE,))) is None:
        new = end.join(["", REMARK, f"[{TABLE}]", *lines, ""])
        return text + (end if text and not text.endswith("\n") else "") + new
    last = max(span.stop for path, span in document.spans.items() if path[0] == TABLE)
    if text[table.start] == "{":
        inside = [span.stop for path, span in document.spans.items() if path[:1] == (TABLE,) and path[1:]]
        place = max(inside, default=table.start + 1)
        return text[:place] + (", " if inside else " ") + ", ".join(lines) + text[place:]
    has_header = text[: table.start].rstrip(" \t").endswith("[")
    prefix = "" if has_header else f"{TABLE}."
    line_end = re.compile(r"\n|\Z").search(text, last)
    assert line_end is not None  # noqa: S101 - the text has an end
    new = "".join(f"{prefix}{line}{end}" for line in lines)
    first, rest = text[: line_end.end()], text[line_end.end() :]
    return first + ("" if first.endswith("\n") else end) + new + rest
