"""Paragraphs and blocks of text for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

COLUMNS = 80


def wrapped(text: str, *, indent: int = 0) -> str:
    """``text`` in lines of at most 80 columns, further lines indented; no word is broken."""
    return textwrap.fill(
        text, COLUMNS, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def blocks(parts: Iterable[str]) -> str:
    """The parts that are not empty, with a blank line between them."""
    return "\n\n".join(part for part in parts if part)
