"""Where each value stands in a TOML text.

Parsers give values without their places; to change a number and nothing else, and to name the line
of a wrong one, the places are needed. The scanner here only finds where tokens begin and end. What
they mean, and whether the text is TOML at all (https://toml.io/en/v1.0.0), is left to ``tomllib``,
which must have accepted the text before.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass

KeyPath = tuple[str | int, ...]
"""Keys of tables and, counted from 0, positions in arrays, from the document's root."""

BYTE_ORDER_MARK = "\ufeff"

_BLANKS = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BASIC_STRING = r'"(?:[^"\\]|\\.)*"'
_LITERAL_STRING = r"'[^']*'"
_STRING = re.compile(
    # Up to two quotation marks may stand right before the three that end a multi-line string.
    r'"""(?:[^\\]|\\.)*?"{3,5}' + r"|'''.*?'{3,5}|" + _BASIC_STRING + "|" + _LITERAL_STRING,
    re.DOTALL,
)
# A date may have a blank between day and time, so a bare value ends where something else begins.
_BARE_VALUE = re.compile(r"[^,\]}#\r\n]*")
_KEYS = re.compile(rf"""(?:{_BASIC_STRING}|{_LITERAL_STRING}|[^"'=\]])+""")


@dataclass(frozen=True, slots=True)
class Span:
    """The characters ``text[start:end]``."""

    start: int
    end: int

    def of(self, text: str) -> str:
        """The characters themselves."""
        return text[self.start : self.end]


def locate(text: str) -> dict[KeyPath, Span]:
    """Where everything stands in a valid TOML text.

    Values, also those inside arrays and inline tables, have the span of the whole value; a table
    that is opened by a header or by a dotted key has the span of the keys that mention it first.
    """
    return _Scanner(text).document()


def line_of(text: str, offset: int) -> int:
    """The line, from 1, of the character at ``offset``."""
    return text.count("\n", 0, offset) + 1


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = len(BYTE_ORDER_MARK) if text.startswith(BYTE_ORDER_MARK) else 0
        self._table: KeyPath = ()
        self._spans: dict[KeyPath, Span] = {}
        self._lengths: dict[KeyPath, int] = {}

    def document(self) -> dict[KeyPath, Span]:
        while self._next():
            if self._next() == "[":
                self._header()
            else:
                self._key_and_value(self._table)
        return self._spans

    def _next(self) -> str:
        self._match(_BLANKS)
        return self._text[self._at : self._at + 1]

    def _match(self, pattern: re.Pattern[str]) -> Span:
        match = pattern.match(self._text, self._at)
        assert match is not None, f"no TOML at {self._at}: tomllib has not seen this text"  # noqa: S101
        self._at = match.end()
        return Span(match.start(), match.end())

    def _header(self) -> None:
        brackets = 2 if self._text.startswith("[[", self._at) else 1
        self._at += brackets
        span = self._match(_KEYS)
        self._at += brackets
        self._table = self._opened((), span)
        if brackets == 2:
            index = self._lengths.get(self._table, 0)
            self._lengths[self._table] = index + 1
            self._table = (*self._table, index)
            self._spans[self._table] = span

    def _opened(self, path: KeyPath, span: Span) -> KeyPath:
        for key in _keys(span.of(self._text)):
            # A header below an array of tables speaks of the table opened last.
            path = (*path, self._lengths[path] - 1) if path in self._lengths else path
            path = (*path, key)
            self._spans.setdefault(path, span)
        return path

    def _key_and_value(self, table: KeyPath) -> None:
        path = self._opened(table, self._match(_KEYS))
        self._at += len("=")
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        first, start = self._next(), self._at
        if first == "[":
            self._array(path)
        elif first == "{":
            self._inline_table(path)
        elif first in {'"', "'"}:
            self._match(_STRING)
        else:
            self._at = start + len(self._match(_BARE_VALUE).of(self._text).rstrip(" \t"))
        self._spans[path] = Span(start, self._at)

    def _array(self, path: KeyPath) -> None:
        self._at += len("[")
        index = 0
        while self._next() != "]":
            self._value((*path, index))
            index += 1
            self._skip_comma()
        self._at += len("]")

    def _inline_table(self, path: KeyPath) -> None:
        self._at += len("{")
        while self._next() != "}":
            self._key_and_value(path)
            self._skip_comma()
        self._at += len("}")

    def _skip_comma(self) -> None:
        if self._next() == ",":
            self._at += len(",")


def _keys(dotted: str) -> list[str]:
    node: object = tomllib.loads(f"{dotted} = 0")
    keys = []
    while isinstance(node, dict):
        [(key, node)] = node.items()
        keys.append(key)
    return keys
