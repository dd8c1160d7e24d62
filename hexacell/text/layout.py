"""Paragraphs of text for a terminal of 80 columns."""

from __future__ import annotations

import textwrap

COLUMNS = 80


def wrapped(text: str, *, indent: int = 0) -> str:
    """``text`` in lines of at most 80 columns, further lines indented; no word is broken."""
    return textwrap.fill(
        text, COLUMNS, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def duration(minutes: float) -> str:
    """A duration, rounded to what is known of it."""
    return f"{60.0 * minutes:.0f} seconds" if minutes < 1.5 else f"{minutes:.0f} minutes"
