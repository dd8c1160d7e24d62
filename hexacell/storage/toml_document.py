"""A TOML text as read: values, the place of each, errors with file and line, replaced numbers.

Errors name the line of a wrong value, and a write-back replaces numbers and nothing else; ``tomllib`` gives
values without their places. The scanner here only finds where tokens begin and end. What they mean, and
whether the text is TOML at all (https://toml.io/en/v1.0.0), is decided by ``tomllib``, which must have
accepted the text before.

Secret is the text behind a key whose name ends with ``password``, ``secret``, ``token`` or the like, also
in a comment, and the password in an address such as ``http://user:password@host``.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from hexacell.errors import FileError
from hexacell.storage.atomic_files import BYTE_ORDER_MARK

KeyPath = tuple[str | int, ...]
"""Keys of tables and, counted from 0, positions in arrays, from the document's root."""

SECRET_WORDS = "password|passwd|passphrase|secret|token|api_?key"  # noqa: S105 - names of keys
"""Keys that end so are followed by something that no message and no copy of a file shows."""

MASK = "***"

_IN_A_COMMENT = re.compile(
    rf"(#[^\r\n]*?(?:{SECRET_WORDS})[\"']?[ \t]*[=: \t][ \t]*)[^\r\n]+", re.IGNORECASE
)
# What follows a host's port and a question mark is no password: mailto://host:25?from=a@b.
_IN_AN_ADDRESS = re.compile(r"(://[^\s/:@\"']*:)(?!\d{1,5}[?#])[^\s/@\"']+(?=@)")
_LIKE_A_SECRET = re.compile(
    rf"((?:{SECRET_WORDS}|connectpw|enablepw)[\"']?[ \t]*[=: \t][ \t]*)[^\r\n]+", re.IGNORECASE
)

_LONGEST_QUOTE = 40
# Python's own parser takes hours for a key of a hundred thousand parts.
_ENDLESS_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){100}""")
_SECRET_KEY = re.compile(rf"(?:^|.*[^a-z])(?:{SECRET_WORDS})", re.IGNORECASE)
_POSITION = re.compile(r" \(at (?:line (?P<line>\d+), column \d+|end of document)\)$")


@dataclass(frozen=True, slots=True)
class TomlDocument:
    """The values of a TOML text as ``tomllib`` reads them, and where in the text each of them stands.

    ``source`` is the file that errors name; a text may have none.
    """

    text: str
    data: Mapping[str, Any]
    spans: Mapping[KeyPath, slice]
    source: Path | None = None

    @classmethod
    def parse(cls, text: str, source: Path | None = None) -> Self:
        """The document in ``text``; raises ``FileError`` with the line where it is no TOML."""
        if (found := _ENDLESS_KEY.search(text)) is not None:
            line = text.count("\n", 0, found.start()) + 1
            raise FileError("a key has too many parts", subject=source, line=line, action="Shorten it")
        with _file_errors(text, source):
            return cls(text, tomllib.loads(text.removeprefix(BYTE_ORDER_MARK)), locate(text), source)

    def to_json(self) -> str:
        """The values as JSON, dates and times as text; raises ``FileError`` for endless integers."""
        with _file_errors("", self.source):
            return json.dumps(self.data, default=str)

    def value(self, path: KeyPath) -> Any:  # noqa: ANN401 - whatever TOML may hold
        """The value at ``path``; raises ``LookupError``."""
        found: Any = self.data
        for key in path:
            found = found[key]
        return found

    def line_of(self, path: KeyPath) -> int | None:
        """The line of ``path`` or, where the text does not have it, of the innermost table around it."""
        for length in range(len(path), 0, -1):
            if span := self.spans.get(path[:length]):
                return self.text.count("\n", 0, span.start) + 1
        return None

    def replaced(self, tokens: Mapping[KeyPath, str]) -> str:
        """The text with other tokens at the given places."""
        text = self.text
        for path in sorted(tokens, key=lambda path: self.spans[path].start, reverse=True):
            span = self.spans[path]
            text = text[: span.start] + tokens[path] + text[span.stop :]
        return text

    def error(self, path: KeyPath, problem: str, action: str) -> FileError:
        """A problem at ``path``, with its line."""
        return FileError(problem, subject=self.source, line=self.line_of(path), action=action)

    def mismatch(self, path: KeyPath, expected: str) -> str:
        """What is at ``path`` and what must be there, as the problem of an error; a secret is not shown."""
        if is_secret(path):
            return f"{self.place(path)} must be {expected}"
        return f"{self.place(path)} is {_description(self.value(path))}, but must be {expected}"

    def place(self, path: KeyPath) -> str:
        """A place as a person finds it: ``'S' in [robot.nominal], row 4, number 2``."""
        last = max(depth for depth, key in enumerate(path) if isinstance(key, str))
        table = path[:last]
        numbers = "".join(f" number {key + 1}" for key in table if isinstance(key, int))
        where = f"in {table_header(table)}{numbers}" if table else "at the top of the file"
        words = f"'{path[last]}' {where}"
        for depth in range(last + 1, len(path)):
            item = "row" if isinstance(self.value(path[: depth + 1]), list) else "number"
            words += f", {item} {int(path[depth]) + 1}"
        return words


def is_secret(path: KeyPath) -> bool:
    """Whether the value at a path is one that nobody but the user may read."""
    names = [key for key in path if isinstance(key, str)]
    return bool(names) and _SECRET_KEY.fullmatch(names[-1]) is not None


def table_header(path: KeyPath) -> str:
    """The header that opens the table at ``path``: ``[robot.nominal]``, ``[[gauges]]``."""
    names = ".".join(key for key in path if isinstance(key, str))
    return f"[[{names}]]" if isinstance(path[-1], int) else f"[{names}]"


def _description(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'the text "{shortened(value)}"'
        case int() | float():
            return shortened(repr(value))
        case list():
            return f"a list of {len(value)} item{'' if len(value) == 1 else 's'}"
        case dict():
            return "a section"
        case _:
            return "a date or a time"


def shortened(text: str) -> str:
    """A text to be quoted in a line of a message."""
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."


@contextmanager
def _file_errors(text: str, source: Path | None) -> Iterator[None]:
    try:
        yield
    except tomllib.TOMLDecodeError as error:
        position = _POSITION.search(str(error))
        last = text.count("\n") + (not text.endswith("\n"))
        line = int(position["line"]) if position and position["line"] else last
        problem = _POSITION.sub("", str(error))
        # "Cannot overwrite a value", "Cannot declare ('gauges',) twice" and similar messages.
        problem = "a key or a section is defined twice" if problem.startswith("Cannot ") else problem
        raise FileError(
            f"not valid TOML: {problem}", subject=source, line=line, action="Correct this line"
        ) from error
    except RecursionError:
        raise FileError("brackets are nested too deeply", subject=source, action="Remove some") from None
    except ValueError:
        # Python refuses to read or write integers of thousands of digits, without saying where.
        raise FileError("a number has too many digits", subject=source, action="Shorten it") from None


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


@lru_cache(maxsize=8)
def locate(text: str) -> Mapping[KeyPath, slice]:
    """The part of ``text``, valid TOML, that is each table, value and array element.

    That of a table is the header or dotted key that mentions it first. Kept for a few texts: these are
    parsed again and again, and the scanner is slow.
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


def clear_secrets(document: TomlDocument) -> list[KeyPath]:
    """Where the secrets of a document stand that are not masked."""
    found = [path for path in document.spans if is_secret(path) and document.value(path) != MASK]
    return [path for path in found if not isinstance(document.value(path), list | dict)]


@lru_cache(maxsize=4)
def without_secrets(text: str) -> str:
    """A valid TOML text with every secret masked; every other character is kept."""
    document = TomlDocument.parse(text)
    masked = TomlDocument.parse(document.replaced(dict.fromkeys(clear_secrets(document), f'"{MASK}"')))
    values = [span for at, span in masked.spans.items() if not isinstance(masked.value(at), list | dict)]

    def in_a_comment(found: re.Match[str]) -> str:
        is_in_a_value = any(span.start <= found.start() < span.stop for span in values)
        return found[0] if is_in_a_value else f"{found[1]}{MASK}"

    return _IN_AN_ADDRESS.sub(rf"\g<1>{MASK}", _IN_A_COMMENT.sub(in_a_comment, masked.text))


def with_lines_masked(text: str) -> str:
    """Any text, valid or not, with what follows the name of a secret masked up to the end of its line."""
    return _IN_AN_ADDRESS.sub(rf"\g<1>{MASK}", _LIKE_A_SECRET.sub(rf'\g<1>"{MASK}"', text))
