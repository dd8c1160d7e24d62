"""Paragraphs and blocks for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

COLUMNS = 80


def wrapped(text: str, *, indent: int = 0) -> str:
    """``text`` broken where a terminal would end, further lines indented; words stay whole."""
    return textwrap.fill(
        text, COLUMNS, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def blocks(parts: Iterable[str]) -> str:
    """Parts with a blank line between them; empty ones are left out."""
    return "\n\n".join(part for part in parts if part)
