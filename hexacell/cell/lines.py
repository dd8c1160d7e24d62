"""On which line of a cell file a value stands."""

from __future__ import annotations

from collections.abc import Mapping

from hexacell.controller_config import toml_positions
from hexacell.controller_config.toml_positions import KeyPath


def locate(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table, key and array element in valid TOML ``text``.

    A table stands where it is first mentioned: at its header or at a header below it.
    """
    spans = toml_positions.locate(text)
    return {path: toml_positions.line_of(text, span.start) for path, span in spans.items()}


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int | None:
    """The line of ``path`` or, where the file does not have it, of the nearest place around it."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return None
