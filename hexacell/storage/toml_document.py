"""A TOML text as read: its values, the place of each, and errors that name file and line."""

from __future__ import annotations

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
from hexacell.storage.toml_locations import KeyPath, locate

SECRET_WORDS = "password|passwd|passphrase|secret|token|api_?key"  # noqa: S105 - names of keys
"""Keys that end so are followed by something that no message and no copy of a file shows."""

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
            return cls(text, tomllib.loads(text.removeprefix(BYTE_ORDER_MARK)), _located(text), source)

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
        """The text with other tokens at the given places (see :mod:`.toml_edit`)."""
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
        words = f"'{path[last]}' {_table_words(path[:last])}"
        for depth in range(last + 1, len(path)):
            item = "row" if isinstance(self.value(path[: depth + 1]), list) else "number"
            words += f", {item} {int(path[depth]) + 1}"
        return words


@lru_cache(maxsize=8)
def _located(text: str) -> Mapping[KeyPath, slice]:
    """The same few texts are parsed again and again, and the scanner takes most of the time."""
    return locate(text)


def is_secret(path: KeyPath) -> bool:
    """Whether the value at a path is one that nobody but the user may read."""
    names = [key for key in path if isinstance(key, str)]
    return bool(names) and _SECRET_KEY.fullmatch(names[-1]) is not None


def table_header(path: KeyPath) -> str:
    """The header that opens the table at ``path``: ``[robot.nominal]``, ``[[gauges]]``."""
    names = ".".join(key for key in path if isinstance(key, str))
    return f"[[{names}]]" if isinstance(path[-1], int) else f"[{names}]"


def _table_words(path: KeyPath) -> str:
    if not path:
        return "at the top of the file"
    numbers = [f" number {key + 1}" for key in path if isinstance(key, int)]
    return f"in {table_header(path)}{''.join(numbers)}"


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
        raise _syntax_error(str(error), text, source) from error
    except RecursionError:
        raise FileError("brackets are nested too deeply", subject=source, action="Remove some") from None
    except ValueError:
        # Python refuses to read or write integers of thousands of digits, without saying where.
        raise FileError("a number has too many digits", subject=source, action="Shorten it") from None


def _syntax_error(message: str, text: str, source: Path | None) -> FileError:
    position = _POSITION.search(message)
    last = text.count("\n") + (not text.endswith("\n"))
    line = int(position["line"]) if position and position["line"] else last
    problem = _POSITION.sub("", message)
    # "Cannot overwrite a value", "Cannot declare ('gauges',) twice" and similar messages.
    problem = "a key or a section is defined twice" if problem.startswith("Cannot ") else problem
    return FileError(f"not valid TOML: {problem}", subject=source, line=line, action="Correct this line")
