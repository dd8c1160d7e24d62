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

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.config.interface import (
    LARGEST_BACKLASH,
    LARGEST_COMPLIANCE_UM_N,
    LARGEST_PLAY_MM,
    write_number,
)
from hexacell.errors import FileError
from hexacell.kinematics.corrections import NO_CORRECTIONS, Corrections
from hexacell.kinematics.parameters import LEGS
from hexacell.storage.toml_document import KeyPath, TomlDocument

TABLE = "corrections"
REMARK = "# What the controller adds for what is not geometry: play, backlash, compliance under a weight."


@dataclass(frozen=True, slots=True)
class _Key:
    """What may stand behind a key: so many numbers, 0 for one without brackets."""

    count: int
    lowest: float
    highest: float
    decimals: int = 6
    may_be_empty: bool = False

    @property
    def expected(self) -> str:
        """In words."""
        numbers = f"a list of {self.count} numbers" if self.count else "a number"
        return f"{numbers} or []" if self.may_be_empty else numbers


_KEYS = {
    "backlash": _Key(LEGS, -LARGEST_BACKLASH, LARGEST_BACKLASH),
    "play_mm": _Key(LEGS, -LARGEST_PLAY_MM, LARGEST_PLAY_MM),
    "compliance_um_n": _Key(LEGS, 0.0, LARGEST_COMPLIANCE_UM_N),
    "weight_n": _Key(0, 0.0, LARGEST_NUMBER),
    "weight_direction": _Key(3, -LARGEST_NUMBER, LARGEST_NUMBER, decimals=9),
    "weight_centre_mm": _Key(3, -LARGEST_NUMBER, LARGEST_NUMBER, may_be_empty=True),
}


def read_corrections(document: TomlDocument) -> Corrections:
    """The corrections in a document; raises ``FileError`` with the line of what is wrong."""
    if TABLE not in document.data:
        return NO_CORRECTIONS
    table = document.data[TABLE]
    if not isinstance(table, dict):
        raise _error(document, (TABLE,), document.mismatch((TABLE,), "a section"))
    if unknown := next((key for key in table if key not in _KEYS), None):
        raise _error(document, (TABLE, unknown), f"[{TABLE}] has {unknown!r}, which is no correction")
    found: dict[str, Any] = {key: _value(document, key) for key in table}
    if direction := found.get("weight_direction"):
        if not (length := float(np.linalg.norm(direction))):
            raise _error(document, (TABLE, "weight_direction"), "the weight has no direction")
        found["weight_direction"] = tuple(part / length for part in direction)
    return Corrections(**found)


def with_corrections(text: str, corrections: Corrections) -> str:
    """``text`` with these corrections; raises ``FileError`` where it holds what is no correction."""
    document = TomlDocument.parse(text)
    before, tokens, added = read_corrections(document), dict[KeyPath, str](), dict[str, str]()
    for key, form in _KEYS.items():
        old, new = _numbers(before, key), _numbers(corrections, key)
        half_of_last = 0.5 * 10.0**-form.decimals
        if len(old) == len(new) and np.allclose(old, new, rtol=0.0, atol=half_of_last):
            continue
        written = [write_number(value, form.decimals) for value in new]
        if (TABLE, key) not in document.spans:
            added[key] = f"[{', '.join(written)}]" if form.count else written[0]
        elif not form.count:
            tokens[TABLE, key] = written[0]
        elif len(old) != len(new) or key == "weight_direction":
            # A direction that is no unit vector in the text would change its meaning number by number.
            tokens[TABLE, key] = f"[{', '.join(written)}]"
        else:
            for place, token in enumerate(written):
                if abs(new[place] - old[place]) > half_of_last:
                    tokens[TABLE, key, place] = token
    return _with_keys(document.replaced(tokens), added)


def _numbers(corrections: Corrections, key: str) -> tuple[float, ...]:
    value = getattr(corrections, key)
    return () if value is None else tuple(value) if isinstance(value, tuple) else (value,)


def _with_keys(text: str, added: Mapping[str, str]) -> str:
    """``text`` with new keys behind those of the table, wherever that is."""
    if not added:
        return text
    document, end = TomlDocument.parse(text), "\r\n" if "\r\n" in text else "\n"
    lines = [f"{key} = {value}" for key, value in added.items()]
    table = document.spans.get((TABLE,))
    if table is None:
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


def _value(document: TomlDocument, key: str) -> Any:  # noqa: ANN401 - a number, several, or none
    form, value = _KEYS[key], document.data[TABLE][key]
    if not form.count:
        return _number(document, (TABLE, key), form)
    if form.may_be_empty and value == []:
        return None
    if not isinstance(value, list) or len(value) != form.count:
        raise _error(document, (TABLE, key), document.mismatch((TABLE, key), form.expected))
    return tuple(_number(document, (TABLE, key, place), form) for place in range(form.count))


def _number(document: TomlDocument, path: KeyPath, form: _Key) -> float:
    value = document.value(path)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not form.lowest <= value <= form.highest:  # NaN is not between them
        expected = f"a number from {form.lowest:g} to {form.highest:g}"
        raise _error(document, path, document.mismatch(path, expected))
    return float(value)


def _error(document: TomlDocument, path: KeyPath, problem: str) -> FileError:
    return document.error(path, problem, f"[{TABLE}] may have {', '.join(_KEYS)}")
