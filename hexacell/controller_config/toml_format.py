"""The native controller config: TOML with the geometry in ``[geometry]``, and whatever else.

    [geometry]
    S = [[x, y, z], ...]    # six joints on the sliders, base frame, mm
    B = [[x, y, z], ...]    # six joints on the platform, platform frame, mm
    l = [...]               # six leg lengths, mm
    branch = [1, ...]       # six signs

The file belongs to the robot's owner. A write-back puts new number tokens into the places of old
ones and leaves every other character alone; TOML writers cannot promise that, so none is used.

The ``[geometry]`` of a TOML text: checked, with the line of whatever is wrong with it.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np

from hexacell.controller_config.interface import Branch, ControllerGeometry
from hexacell.errors import FileError
from hexacell.kinematics.geometry import LEGS, Geometry
from hexacell.storage import atomic_files
from hexacell.storage.toml_locations import BYTE_ORDER_MARK, KeyPath, Span, line_of, locate

_DECIMALS = 6
_HALF_A_NANOMETRE = 5e-7


class NativeToml:
    """The format ``toml``, a :class:`~hexacell.controller_config.interface.ConfigFormat`."""

    def read(self, path: Path) -> ControllerGeometry:
        """The geometry, mm, and the branch in the file; raises ``FileError`` with file and line."""
        config = TomlConfig.parse(atomic_files.read_text(path), path)
        return ControllerGeometry(config.geometry(), config.branch())

    def rewrite(self, text: str, geometry: Geometry) -> str:
        """``text`` with ``geometry`` in it: six decimals (1 nm), no exponent.

        A value that differs by no more than half a nanometre keeps its token. The new text is read
        again before it is given out.

        Raises:
            FileError: ``text`` is no such config, or ``geometry`` has a value that is not finite or
                a leg that is not longer than zero.
        """
        _require_physical(geometry)
        config = TomlConfig.parse(text)
        changed = _spliced(text, _replacements(config, geometry))
        _require_faithful(config, TomlConfig.parse(changed), geometry)
        return changed


def number_token(value: float) -> str:
    """``value`` as a TOML float: at most six decimals, at least one, never ``-0.0``."""
    whole, _, decimals = f"{value:.{_DECIMALS}f}".partition(".")
    number = f"{whole}.{decimals.rstrip('0') or '0'}"
    return "0.0" if number == "-0.0" else number


def _require_physical(geometry: Geometry) -> None:
    if not np.isfinite(geometry.vector()).all() or not (geometry.l > 0).all():
        raise FileError(
            "the new geometry has values that are not finite, or legs that are not longer than zero",
            action="Nothing was written; identify again",
        )


def _values(geometry: Geometry) -> Iterator[tuple[KeyPath, float]]:
    for name in ("S", "B", "l"):
        for place, value in np.ndenumerate(getattr(geometry, name)):
            yield ("geometry", name, *place), float(value)


def _replacements(config: TomlConfig, geometry: Geometry) -> Iterator[tuple[Span, str]]:
    pairs = zip(_values(config.geometry()), _values(geometry), strict=True)
    for (place, old), (_, new) in pairs:
        if abs(new - old) > _HALF_A_NANOMETRE:
            yield config.spans[place], number_token(new)


def _spliced(text: str, replacements: Iterator[tuple[Span, str]]) -> str:
    # From the end, so that the spans still to come keep their places.
    for span, token in sorted(replacements, key=lambda item: item[0].start, reverse=True):
        text = text[: span.start] + token + text[span.end :]
    return text


def _require_faithful(old: TomlConfig, new: TomlConfig, geometry: Geometry) -> None:
    written = new.geometry().largest_difference(geometry) <= 2 * _HALF_A_NANOMETRE
    if not written or _without_geometry(old) != _without_geometry(new):
        raise FileError(
            "the new geometry does not read back as it was written",
            action="Nothing was written; please report this with the config",
        )


def _without_geometry(config: TomlConfig) -> str:
    rest: dict[str, Any] = deepcopy(config.data)
    for name in ("S", "B", "l"):
        del rest["geometry"][name]
    # As text, because a NaN in somebody's own table does not equal itself.
    return repr(rest)


_AXES = 3
_NEEDED = (
    "[geometry] needs S and B (six rows of three numbers, mm), l (six lengths, mm) and branch (six signs)"
)


@dataclass(frozen=True, slots=True)
class TomlConfig:
    """A native config: its text, what ``tomllib`` makes of it, and where everything stands.

    ``source`` is the file that errors name; a text may have none.
    """

    text: str
    source: Path | None
    data: dict[str, Any]
    spans: dict[KeyPath, Span]

    @classmethod
    def parse(cls, text: str, source: Path | None = None) -> TomlConfig:
        """The config in ``text``; raises ``FileError`` with the line where that is no TOML."""
        try:
            data = tomllib.loads(text.removeprefix(BYTE_ORDER_MARK))
        except (ValueError, RecursionError) as error:
            problem, line = _syntax_problem(error, text)
            raise FileError(problem, subject=source, line=line, action="Correct this line") from error
        return cls(text, source, data, locate(text))

    def geometry(self) -> Geometry:
        """The 42 numbers, mm; raises ``FileError`` with the line where they are not that."""
        S, B = self._points("S"), self._points("B")
        place = ("geometry", "l")
        lengths = self._numbers(place, self._entry(*place), "l")
        for leg, length in enumerate(lengths):
            if length <= 0:
                self._fail(f"leg {leg + 1} is {length} mm long; it must be longer than zero", (*place, leg))
        return Geometry(S=S, B=B, l=lengths)

    def branch(self) -> Branch:
        """The six signs, in ``[geometry]`` or at the top of the file; raises ``FileError``."""
        place = ("branch",) if "branch" in self.data else ("geometry", "branch")
        signs = self._entry(*place)
        if not isinstance(signs, list) or len(signs) != LEGS:
            self._fail(f"branch is {describe(signs)}; it must be six signs", place)
        for leg, sign in enumerate(signs):
            if isinstance(sign, bool) or sign not in (1, -1):
                self._fail(f"the branch of leg {leg + 1} is {sign!r}; it must be 1 or -1", (*place, leg))
        return cast("Branch", tuple(int(sign) for sign in signs))

    def _entry(self, *place: str) -> object:
        node: object = self.data
        for depth, key in enumerate(place):
            if not isinstance(node, dict):
                self._fail(f"{place[depth - 1]} is {describe(node)}; it must be a table", place[:depth])
            if key not in node:
                missing = f"[{place[depth - 1]}] has no {key}" if depth else f"there is no [{key}]"
                self._fail(missing, place[:depth])
            node = node[key]
        return node

    def _points(self, name: str) -> list[list[float]]:
        rows = self._entry("geometry", name)
        if (
            not isinstance(rows, list)
            or len(rows) != LEGS
            or not all(isinstance(row, list) for row in rows)
        ):
            wanted = f"{LEGS} rows of {_AXES} numbers"
            self._fail(f"{name} is {describe(rows)}; it must be {wanted}", ("geometry", name))
        return [
            self._numbers(("geometry", name, leg), row, f"row {leg + 1} of {name}", _AXES)
            for leg, row in enumerate(rows)
        ]

    def _numbers(self, place: KeyPath, values: object, words: str, count: int = LEGS) -> list[float]:
        if not isinstance(values, list) or len(values) != count:
            self._fail(f"{words} is {describe(values)}; it must be {count} numbers", place)
        return [self._number((*place, index), value) for index, value in enumerate(values)]

    def _number(self, place: KeyPath, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._fail(f"{describe(value)} stands where a number must", place)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self._fail(f"{number} stands where a finite number must", place)
        return number

    def _fail(self, problem: str, place: KeyPath) -> NoReturn:
        span = self.spans.get(place)
        line = None if span is None else line_of(self.text, span.start)
        raise FileError(problem, subject=self.source, line=line, action=_NEEDED)


def describe(value: object) -> str:
    """What ``value`` is, for a message that says what was found instead of what must be there."""
    if isinstance(value, dict):
        return "a table"
    if not isinstance(value, list):
        return f"the {'text' if isinstance(value, str) else 'value'} {value!r}"
    if not value or not all(isinstance(row, list) for row in value):
        return "1 value" if len(value) == 1 else f"{len(value)} values"
    widths = [str(len(row)) for row in value]
    columns = widths[0] if len(set(widths)) == 1 else _in_words(widths)
    return f"{len(value)} rows of {columns} numbers"


def _in_words(items: Iterable[str]) -> str:
    *first, last = items
    return f"{', '.join(first)} and {last}"


def _syntax_problem(error: Exception, text: str) -> tuple[str, int]:
    message = str(error)
    found = re.search(r"\s*\(at line (\d+), column \d+\)", message)
    line = int(found[1]) if found else line_of(text, len(text))
    words = message.replace(found[0], "") if found else message.replace("(at end of document)", "").strip()
    return f"this is not TOML: {words[:1].lower()}{words[1:]}", line
