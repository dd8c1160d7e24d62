"""Numbers of a TOML text replaced, every other character kept.

``tomlkit`` keeps comments, blanks, line ends and the spelling of numbers, but not every text: a table
between two tables of one array of tables moves behind them, blanks after a date inside an array are
dropped, and a hundred levels of brackets are refused. So its output is never used unchecked: the numbers
to replace become marks, and the text between the marks, filled with the old numbers, must be the old text.
Where it is not, the numbers are replaced at the places that :mod:`.toml_locations` finds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import getitem
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Float, Trivia

from hexacell.storage.atomic_files import BYTE_ORDER_MARK
from hexacell.storage.toml_document import TomlDocument
from hexacell.storage.toml_locations import KeyPath

_MARK = "\0"
"""TOML allows this character nowhere."""


def replace_numbers(document: TomlDocument, tokens: Mapping[KeyPath, str]) -> str:
    """The text of ``document`` with other tokens at the given places, each of which holds a number."""
    body = document.text.removeprefix(BYTE_ORDER_MARK)
    mark = document.text[: len(document.text) - len(body)]
    edited = _edited(body, tokens)
    return document.replaced(tokens) if edited is None else mark + edited


def _edited(body: str, tokens: Mapping[KeyPath, str]) -> str | None:
    """``body`` edited by ``tomlkit``; none where it would change anything else."""
    try:
        document = tomlkit.parse(body)
    except TOMLKitError:
        return None
    old = [_exchange(document, path, f"{_MARK}{n}{_MARK}") for n, path in enumerate(tokens)]
    pieces = document.as_string().split(_MARK)
    return _filled(pieces, list(tokens.values())) if _filled(pieces, old) == body else None


def _exchange(document: Any, path: KeyPath, token: str) -> str:  # noqa: ANN401 - tomlkit's containers
    """Put ``token`` in the place of the number at ``path`` and return the old token."""
    container = reduce(getitem, path[:-1], document)
    old: str = container[path[-1]].as_string()
    container[path[-1]] = Float(0.0, Trivia(), token)
    return old


def _filled(pieces: Sequence[str], tokens: Sequence[str]) -> str:
    """``pieces`` joined; every second one is the number of a token."""
    return "".join(tokens[int(piece)] if n % 2 else piece for n, piece in enumerate(pieces))
