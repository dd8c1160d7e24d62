"""What a report is made of, and how it is written: as one HTML file, or as PDF/A-2b by typst (optional).

The HTML needs no other file, no script and no network. Both are the same, byte for byte, each time.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hexacell.errors import UsageError
from hexacell.printable import printable

TEMPLATES = Path(__file__).parent
PDF_STANDARD: Final = "a-2b"


class Tone(StrEnum):
    """How a verdict is coloured, and the sign that says the same without colour."""

    GOOD = "good"
    OPEN = "open"
    BAD = "bad"

    @property
    def sign(self) -> str:
        """The sign before the verdict."""
        return {Tone.GOOD: "\u2713", Tone.OPEN: "?", Tone.BAD: "\u2717"}[self]


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Some sentences; ``is_strong`` marks what a reader must see first."""

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

    @property
    def first_number(self) -> int:
        """The first column of numbers; beyond the last one if there is none."""
        return len(self.columns) if self.numbers_from is None else self.numbers_from

    @property
    def widths(self) -> list[str]:
        """Widths for typst: by the longest texts; without numbers the longest column takes what is left."""
        longest = [max(map(len, column)) for column in zip(self.columns, *self.rows, strict=True)]
        if self.numbers_from is not None:
            return [f"{size + 2}fr" for size in longest]
        return ["1fr" if size == max(longest) else "auto" for size in longest]


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing as SVG text, and what it shows in words, for those who do not see it.

    ``series`` are the names of parts, in groups ``series-1`` and so on, that can be looked at alone;
    ``width`` is its share of the page's.
    """

    svg: str
    caption: str
    series: tuple[str, ...] = ()
    width: str = "100%"


Block = Paragraph | Facts | Table | Picture


@dataclass(frozen=True, slots=True)
class Chapter:
    """A heading and the blocks below it."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A report, whose first page has all but the chapters.

    Attributes:
        identifier: is on each page.
        meaning: the verdict in a sentence.
        cards: the errors with their limits.
        summary: what follows the cards.
        is_simulated: whether the robot was; then every page says so.
        robot_svg: a drawing of the robot; empty without.
    """

    title: str
    identifier: str
    issued: date
    verdict: str
    tone: Tone
    meaning: str
    cards: tuple[Picture, ...]
    summary: tuple[Chapter, ...]
    chapters: tuple[Chapter, ...]
    is_simulated: bool = False
    robot_svg: str = ""


def rendered(
    template: str, written: Callable[[Any], Any] | None = None, *, is_markup: bool = True, **values: object
) -> str:
    """A template of this package with its values: each as ``written`` makes it, or printable.

    ``is_markup`` is whether it is HTML or XML; then every text in it is escaped.
    """
    written = written or _shown
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=is_markup,  # noqa: S701 - in typst each text is a literal
        finalize=written,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["style_string"] = _style_string
    return environment.get_template(template).render(values)


def _shown(value: object) -> object:
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _style_string(text: str) -> str:
    """A string of a style sheet; anything but letters, digits and a few signs by its number."""
    signs = (
        sign if sign.isascii() and (sign.isalnum() or sign in " ._-/") else f"\\{ord(sign):x} "
        for sign in text
    )
    return f'"{"".join(signs)}"'


def html_of(report: Report) -> str:
    """The whole file; every text in it is escaped."""
    return rendered("report.html.j2", report=report)


def pdf_of(report: Report) -> bytes:
    """The whole file.

    Raises:
        UsageError: typst is not installed.
    """
    try:
        import typst  # noqa: PLC0415 - an optional package
    except ImportError as error:
        raise UsageError(
            "a PDF needs the package typst",
            action="Install hexacell[pdf], or name a file that ends in .html",
        ) from error
    # Every text is a string literal, never markup.
    markup = rendered("report.typ.j2", _literal, is_markup=False, report=report).encode()
    fonts = typst.Fonts(include_system_fonts=False, font_paths=_fonts())
    return typst.compile(markup, format="pdf", pdf_standards=PDF_STANDARD, font_paths=fonts)


def _fonts() -> list[str]:
    """Where DejaVu Sans is, which comes with matplotlib: typst has no sans serif of its own."""
    found = find_spec("matplotlib")
    places = (found and found.submodule_search_locations) or ()
    return [str(Path(place) / "mpl-data" / "fonts" / "ttf") for place in places]


def _literal(value: object) -> object:
    """A text as a string literal; without control characters, JSON's escapes are those of typst."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    plain = "".join(sign if sign.isprintable() else " " for sign in value)
    return json.dumps(plain, ensure_ascii=False)
