"""Numbers as they stand in the text of a config, and how new ones are written."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""A decimal number as C, HAL and most controllers read it."""

_NUMBER = re.compile(NUMBER, re.ASCII)


@dataclass(frozen=True, slots=True)
class NumberToken:
    """A number in a text: the characters ``start`` to ``end``, in a line counted from 1."""

    text: str
    start: int
    end: int
    line: int

    @property
    def value(self) -> float:
        """The number.

        Raises:
            ValueError: it is not a number, or beyond what a geometry can hold.
        """
        if not _NUMBER.fullmatch(self.text):
            raise ValueError(f"{self.text!r} is not a number")
        value = float(self.text)
        if not (isfinite(value) and abs(value) <= LARGEST_NUMBER):
            raise ValueError(f"{self.text} is not within +-{LARGEST_NUMBER:g}")
        return value


def write_number(value: float, decimals: int) -> str:
    """``value`` with at most so many decimals and at least one, never ``-0.0``, no exponent."""
    whole, _, rest = f"{value:.{decimals}f}".partition(".")
    number = f"{whole}.{rest.rstrip('0') or '0'}"
    return "0.0" if number == "-0.0" else number


def replace_tokens(text: str, changed: Mapping[NumberToken, str]) -> str:
    """``text`` with other numbers in the places of some tokens; every other character is kept."""
    parts, end = [], 0
    for token in sorted(changed, key=lambda one: one.start):
        parts += [text[end : token.start], changed[token]]
        end = token.end
    return "".join([*parts, text[end:]])


def require_physical(geometry: Geometry) -> None:
    """Refuse values that no config may get.

    Raises:
        FileError: a value is not finite, or a length is not above zero.
    """
    positive = [geometry[kind.symbol] for kind in geometry.parameters.kinds if kind.is_positive]
    if not np.isfinite(geometry.vector).all() or not all((values > 0.0).all() for values in positive):
        raise FileError(
            "the new geometry has values that are not finite, or lengths that are not above zero",
            action="Nothing was written; identify again",
        )


def token_error(token: NumberToken, problem: str, source: Path | None, action: str) -> FileError:
    """What is wrong with a number, with its line."""
    return FileError(problem, subject=source, line=token.line, action=action)


def number_of(token: NumberToken, source: Path | None) -> float:
    """Its value; raises ``FileError`` with its line if it is no number."""
    try:
        return token.value
    except ValueError as error:
        raise token_error(token, str(error), source, "Write a plain number there") from error
