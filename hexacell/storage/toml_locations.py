"""Where every value of a TOML text stands.

Error messages name the line of a wrong value, and a write-back replaces numbers and nothing else;
``tomllib`` gives values without their places. The scanner here only finds where tokens begin and end.
What they mean, and whether the text is TOML at all (https://toml.io/en/v1.0.0), is decided by
``tomllib``, which must have accepted the text before.
"""

from __future__ import annotations

import re
import tomllib

from hexacell.storage.atomic_files import BYTE_ORDER_MARK

KeyPath = tuple[str | int, ...]
"""Keys of tables and, counted from 0, positions in arrays, from the document's root."""

_BLANKS = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BASIC_STRING = r'"(?:[^"\\]|\\.)*"'
_LITERAL_STRING = r"'[^']*'"
_STRING = re.compile(
    # A multi-line string may end with up to two quotation marks before the three that close it.
    r'"""(?:[^\\]|\\.)*?"{3,5}' + r"|'''.*?'{3,5}|" + _BASIC_STRING + "|" + _LITERAL_STRING,
    re.DOTALL,
)
# A date and its time may be separated by a blank, so only the last blanks end a bare value.
_BARE_VALUE = re.compile(r"[^,\]}#\r\n]*(?<![ \t])")
_KEYS = re.compile(rf"""(?:{_BASIC_STRING}|{_LITERAL_STRING}|[^"'=\]])+""")


def locate(text: str) -> dict[KeyPath, slice]:
    """The part of ``text``, valid TOML, that is each table, value and array element.

    That of a table is the header or dotted key that mentions it first.
    """
    return _Scanner(text).document()


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._offset = len(BYTE_ORDER_MARK) if text.startswith(BYTE_ORDER_MARK) else 0
        self._table: KeyPath = ()
        self._spans: dict[KeyPath, slice] = {}
        self._lengths: dict[KeyPath, int] = {}

    def document(self) -> dict[KeyPath, slice]:
        while self._next():
            if self._next() == "[":
                self._header()
            else:
                self._key_and_value(self._table)
        return self._spans

    def _next(self) -> str:
        self._match(_BLANKS)
        return self._text[self._offset : self._offset + 1]

    def _match(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self._text, self._offset)
        assert match is not None, f"no TOML at {self._offset}: tomllib has not accepted this text"  # noqa: S101
        self._offset = match.end()
        return match[0]

    def _header(self) -> None:
        start = self._offset
        brackets = 2 if self._text.startswith("[[", start) else 1
        self._offset += brackets
        self._table = self._open(())
        self._offset += brackets
        if brackets == 2:
            index = self._lengths.get(self._table, 0)
            self._lengths[self._table] = index + 1
            self._table = (*self._table, index)
            self._spans[self._table] = slice(start, self._offset)

    def _open(self, path: KeyPath) -> KeyPath:
        """The path of the keys here, relative to ``path``."""
        start = self._offset
        for key in _split_keys(self._match(_KEYS)):
            # A header below an array of tables continues the last table of the array.
            path = (*path, self._lengths[path] - 1) if path in self._lengths else path
            path = (*path, key)
            self._spans.setdefault(path, slice(start, self._offset))
        return path

    def _key_and_value(self, table: KeyPath) -> None:
        path = self._open(table)
        self._offset += len("=")
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        first = self._next()
        start = self._offset
        if first in {"[", "{"}:
            self._items(path, first)
        else:
            self._match(_STRING if first in {'"', "'"} else _BARE_VALUE)
        self._spans[path] = slice(start, self._offset)

    def _items(self, path: KeyPath, bracket: str) -> None:
        """The elements of an array, or the keys and values of an inline table."""
        self._offset += len(bracket)
        index = 0
        while self._next() not in {"]", "}"}:
            if bracket == "[":
                self._value((*path, index))
            else:
                self._key_and_value(path)
            index += 1
            if self._next() == ",":
                self._offset += len(",")
        self._offset += len(bracket)


def _split_keys(dotted: str) -> list[str]:
    node: object = tomllib.loads(f"{dotted} = 0")
    keys = []
    while isinstance(node, dict):
        [(key, node)] = node.items()
        keys.append(key)
    return keys
