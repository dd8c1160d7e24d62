"""What a report is made of, whatever it is written as."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from enum import StrEnum


class Tone(StrEnum):
    """How a verdict is coloured."""

    GOOD = "good"
    OPEN = "open"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Some sentences; ``is_strong``: what a reader must see first."""

    text: str
    is_strong: bool = False


@dataclass(frozen=True, slots=True)
class Facts:
    """Names, each with its value."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of as many cells as there are columns; from ``numbers_from`` on they are numbers, if any are."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers_from: int | None = 1
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing as SVG text, and what it shows in words, for those who do not see it."""

    svg: str
    caption: str


Block = Paragraph | Facts | Table | Picture


@dataclass(frozen=True, slots=True)
class Chapter:
    """A heading with what is below it."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report.

    Attributes:
        identifier: unique; stands on each page.
        issued: the day that stands for the report: that on which the run ended.
        verdict: in a few words, below the title.
        tone: of the verdict; never the only sign of it.
    """

    title: str
    identifier: str
    issued: date
    verdict: str
    tone: Tone
    chapters: tuple[Chapter, ...]
