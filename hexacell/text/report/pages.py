"""What a report is made of, and how it is written: as one HTML file, or as PDF/A-2b by typst (optional).

The HTML needs no other file, no script and no network. Both are the same, byte for byte, each time.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hexacell.errors import UsageError
from hexacell.printable import printable

TEMPLATES = Path(__file__).parent
PDF_STANDARD: Final = "a-2b"


class Tone(StrEnum):
    """How a verdict is coloured."""

    GOOD = "good"
    OPEN = "open"
    BAD = "bad"


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
    """Rows of as many cells as there are columns, which from ``numbers_from`` on are numbers."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers_from: int = 1


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
    """A report: the verdict and its ``meaning``, errors as ``cards``, robot and ``summary`` are page one.

    ``identifier`` is on each page, and SIMULATED across it where it was; ``tone`` colours the verdict.
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
    robot: Picture | None = None


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
    return environment.get_template(template).render(values)


def _shown(value: object) -> object:
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def html_of(report: Report) -> str:
    """The whole file; every text in it is escaped."""
    return rendered("report.html.j2", report=report)


def pdf_of(report: Report) -> bytes:
    """The whole file; raises ``UsageError`` where typst is not installed."""
    try:
        import typst  # noqa: PLC0415 - an optional package
        from matplotlib import get_data_path  # noqa: PLC0415 - only a PDF needs its fonts
    except ImportError as error:
        raise UsageError(
            "a PDF needs the package typst",
            action="Install hexacell[pdf], or name a file that ends in .html",
        ) from error
    # Every text is a string literal, never markup.
    markup = rendered("report.typ.j2", _literal, is_markup=False, report=report).encode()
    # Typst has no sans serif of its own; matplotlib comes with DejaVu Sans.
    fonts = typst.Fonts(include_system_fonts=False, font_paths=[f"{get_data_path()}/fonts/ttf"])
    return typst.compile(markup, format="pdf", pdf_standards=PDF_STANDARD, font_paths=fonts)


def _literal(value: object) -> object:
    """A text as a string literal; without control characters, JSON's escapes are those of typst."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    plain = "".join(sign if sign.isprintable() else " " for sign in value)
    return json.dumps(plain, ensure_ascii=False)
