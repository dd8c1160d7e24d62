"""Values of a TOML text replaced, every other character kept.

``tomlkit`` finds the values; it keeps comments, blanks, line ends and the spelling of numbers. There are
two texts that it does not keep: a table between two tables of one array of tables moves behind them, and
blanks after a date with a blank inside an array are dropped. So its output is never used unchecked. The
values to replace become marks; the text between the marks, filled with the old values, must be the old
text; filled with the new values it is the new text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Float, Trivia

from hexacell.errors import FileError
from hexacell.storage.toml_document import BYTE_ORDER_MARK
from hexacell.storage.toml_locations import KeyPath

_MARK = "\0"
"""TOML allows this character nowhere."""


def replace_values(text: str, tokens: Mapping[KeyPath, str], source: Path | None = None) -> str:
    """``text`` with other tokens at the given places.

    Args:
        text: valid TOML, with or without a byte order mark.
        tokens: what to write at which place; each place must hold a number.
        source: the file that errors name.

    Raises:
        FileError: ``tomlkit`` does not keep this text; nothing else may be changed, so it is refused.
    """
    body = text.removeprefix(BYTE_ORDER_MARK)
    try:
        document = tomlkit.parse(body)
    except TOMLKitError as error:
        raise _not_editable(str(error), None, source) from error
    old = [_exchange(document, path, f"{_MARK}{n}{_MARK}") for n, path in enumerate(tokens)]
    pieces = document.as_string().split(_MARK)
    unchanged = _filled(pieces, old)
    if unchanged != body:
        line = _first_difference(unchanged, body)
        raise _not_editable("its tables or blanks would be rearranged", line, source)
    return text[: len(text) - len(body)] + _filled(pieces, list(tokens.values()))


def _exchange(document: Any, path: KeyPath, token: str) -> str:  # noqa: ANN401 - tomlkit's containers
    """Put ``token`` in the place of the number at ``path`` and return the old token."""
    container = reduce(getitem, path[:-1], document)
    old: str = container[path[-1]].as_string()
    container[path[-1]] = Float(0.0, Trivia(), token)
    return old


def _filled(pieces: Sequence[str], tokens: Sequence[str]) -> str:
    """``pieces`` joined; every second one is the number of a token."""
    return "".join(tokens[int(piece)] if n % 2 else piece for n, piece in enumerate(pieces))


def _first_difference(text: str, other: str) -> int | None:
    lines = enumerate(zip(text.split("\n"), other.split("\n"), strict=False), start=1)
    return next((number for number, (one, another) in lines if one != another), None)


def _not_editable(reason: str, line: int | None, source: Path | None) -> FileError:
    return FileError(
        f"this file cannot be edited without changing other lines ({reason})",
        subject=source,
        line=line,
        action="Keep the tables of each [[array]] together, and write no blanks after dates in lists",
    )
