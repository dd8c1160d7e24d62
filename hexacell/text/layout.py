"""Paragraphs for a terminal of 80 columns, and what stands in the columns of tables."""

from __future__ import annotations

import textwrap
from datetime import datetime
from typing import TYPE_CHECKING

from hexacell.checks.check_result import ParameterChange
from hexacell.lengths import MM, unit_of
from hexacell.results.run_comparison import ParameterDifference

if TYPE_CHECKING:
    from hexacell.verdict.decision import Verdict, VerifiedAccuracy

COLUMNS = 80


def wrapped(text: str, *, indent: int = 0) -> str:
    """``text`` in lines of at most 80 columns, further lines indented; no word is broken."""
    return textwrap.fill(
        text, COLUMNS, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def duration(minutes: float) -> str:
    """A duration, rounded to what is known of it."""
    return f"{60.0 * minutes:.0f} seconds" if minutes < 1.5 else f"{minutes:.0f} minutes"


def counted(number: int, noun: str) -> str:
    """A number of things: ``1 pose``, ``2 poses``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def minute(at: datetime | None) -> str:
    """A moment to the minute in a column of a table; a dash without one."""
    return "-" if at is None else f"{at:%Y-%m-%d %H:%M}"


def verdict_word(verdict: Verdict | None) -> str:
    """The verdict in a column of a table; a dash without one."""
    return "-" if verdict is None else verdict.value


def figure_with_u(value: float | None, expanded: float | None) -> str:
    """A figure +- its expanded uncertainty in a column of a table; a dash without one."""
    if value is None or expanded is None:
        return "-"
    shown = unit_of(value, expanded)
    text = f"{shown.number(value)} +- {shown.number(expanded)}"
    return text if shown is MM else f"{text} {shown.name}"


def error_with_u(accuracy: VerifiedAccuracy | None) -> str:
    """The largest position error at the task poses, +- its expanded uncertainty, mm; a dash without one."""
    return "-" if accuracy is None else figure_with_u(accuracy.position.value, accuracy.position.expanded)


def change_with_sigma(one: ParameterChange | ParameterDifference) -> str:
    """The change of a parameter with its standard deviation, in words."""
    unit = unit_of(one.change, one.sigma, unit=one.unit)
    return f"{unit.number(one.change, '+')} {unit.name} (sigma {unit.number(one.sigma)})"
