"""What a report is made of, and how it is written: as one HTML file, or as PDF/A-2b by typst (optional).

The HTML needs no other file, no script and no network. Both are the same, byte for byte, each time.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import date
from enum import StrEnum
from html import escape
from typing import Final

from hexacell.errors import UsageError

POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""Nothing is fetched, and nothing runs."""

STYLE = """
@page { size: A4; margin: 18mm 16mm 20mm 16mm;
  @bottom-left { content: var(--identifier); font: 8pt sans-serif; }
  @bottom-right { content: counter(page) " / " counter(pages); font: 8pt sans-serif; } }
body { font: 10.5pt/1.45 "Helvetica Neue", Arial, sans-serif; color: #222; max-width: 178mm;
  margin: 12mm auto; padding: 0 6mm; }
h1 { font-size: 20pt; margin: 0 0 2mm; } h2 { font-size: 12.5pt; margin: 8mm 0 2mm; break-after: avoid; }
p { margin: 1.5mm 0; } .identifier { color: #555; font-size: 9pt; }
.verdict { font-size: 17pt; font-weight: 700; padding: 3mm 4mm; margin: 4mm 0; border-left: 2mm solid; }
.good { border-color: #1b7837; background: #eef7ee; } .bad { border-color: #b2182b; background: #fbeeee; }
.open { border-color: #b8860b; background: #fbf6e6; }
table { border-collapse: collapse; width: 100%; margin: 2mm 0; font-size: 9pt; }
th, td { text-align: left; vertical-align: top; padding: 0.8mm 2mm 0.8mm 0;
  border-bottom: 0.2mm solid #ccc; }
th { border-bottom: 0.4mm solid #222; } tr { break-inside: avoid; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td { overflow-wrap: anywhere; } dl { display: grid; grid-template-columns: 48mm 1fr; gap: 0.8mm 3mm; }
dt { color: #555; } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 3mm 0; break-inside: avoid; } figure svg { width: 100%; height: auto; }
figcaption { font-size: 9pt; color: #555; }
@media print { body { margin: 0; padding: 0; max-width: none; } }
"""

PDF_STANDARD: Final = "a-2b"

PREAMBLE = """
#set document(title: {title}, date: {date})
#set page(paper: "a4", margin: (x: 16mm, top: 18mm, bottom: 20mm), footer: context [
  #set text(8pt)
  #{identifier} #h(1fr) #counter(page).display() / #counter(page).final().first()
])
#set text(font: "Libertinus Serif", size: 10pt, lang: "en")
#set table(
  stroke: (x, y) => (bottom: if y == 0 {{ 0.8pt }} else {{ 0.3pt + luma(190) }}),
  inset: (x: 3pt, y: 2.5pt),
)
#show heading: set block(above: 14pt, below: 6pt)
#show table.cell: set text(8.5pt)
#show table.cell: set block(breakable: false)
#text(20pt, weight: "bold", {title})

#text(9pt, fill: luma(90), {identifier})

#block(width: 100%, inset: 9pt, stroke: (left: 5pt + {colour}), text(17pt, weight: "bold", {verdict}))
"""


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
    """Rows of as many cells as there are columns; from ``numbers_from`` on they are numbers, if any are."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers_from: int | None = 1


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing as SVG text, and what it shows in words, for those who do not see it."""

    svg: str
    caption: str


Block = Paragraph | Facts | Table | Picture


@dataclass(frozen=True, slots=True)
class Chapter:
    """A heading and the blocks below it."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A report: ``identifier`` is on each page, ``tone`` colours the verdict, but is not its only sign."""

    title: str
    identifier: str
    issued: date
    verdict: str
    tone: Tone
    chapters: tuple[Chapter, ...]


def html_of(report: Report) -> str:
    """The whole file; every text in it is escaped."""
    chapters = "\n".join(map(_html_chapter, report.chapters))
    identifier = escape(report.identifier, quote=True)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f"<title>{escape(report.title)}: {identifier}</title>\n"
        f"<style>:root {{ --identifier: {_css_text(report.identifier)}; }}{STYLE}</style>\n"
        "</head>\n<body>\n"
        f'<h1>{escape(report.title)}</h1>\n<p class="identifier">{identifier}</p>\n'
        f'<p class="verdict {report.tone}">{escape(report.verdict)}</p>\n{chapters}\n</body>\n</html>\n'
    )


def _css_text(text: str) -> str:
    """A string of a style sheet; anything but letters, digits and a few signs by its number."""
    signs = (
        sign if sign.isascii() and (sign.isalnum() or sign in " ._-/") else f"\\{ord(sign):x} "
        for sign in text
    )
    return f'"{"".join(signs)}"'


def _html_chapter(chapter: Chapter) -> str:
    blocks = "\n".join(map(_html_block, chapter.blocks))
    return f"<section>\n<h2>{escape(chapter.title)}</h2>\n{blocks}\n</section>"


def _html_block(block: Block) -> str:
    match block:
        case Paragraph(text=text, is_strong=True):
            return f"<p><strong>{escape(text)}</strong></p>"
        case Paragraph(text=text):
            return f"<p>{escape(text)}</p>"
        case Facts(pairs=pairs):
            facts = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in pairs)
            return f"<dl>{facts}</dl>"
        case Picture(svg=svg, caption=caption):
            words = escape(caption, quote=True)
            figure = f"{svg}<figcaption>{words}</figcaption>"
            return f'<figure role="img" aria-label="{words}">{figure}</figure>'
        case Table():
            return _html_table(block)


def _html_table(table: Table) -> str:
    head = "".join(_cell("th", text, column, table) for column, text in enumerate(table.columns))
    rows = "".join(
        f"<tr>{''.join(_cell('td', text, column, table) for column, text in enumerate(row))}</tr>\n"
        for row in table.rows
    )
    return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>"


def _cell(tag: str, text: str, column: int, table: Table) -> str:
    is_number = table.numbers_from is not None and column >= table.numbers_from
    kind = ' class="number"' if is_number else ""
    return f"<{tag}{kind}>{escape(text)}</{tag}>"


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
    return typst.compile(
        typst_of(report).encode(), format="pdf", pdf_standards=PDF_STANDARD, ignore_system_fonts=True
    )


def typst_of(report: Report) -> str:
    """The markup of a report; every text is a string literal, never markup."""
    day = report.issued
    colours = {Tone.GOOD: 'rgb("#1b7837")', Tone.BAD: 'rgb("#b2182b")', Tone.OPEN: 'rgb("#b8860b")'}
    head = PREAMBLE.format(
        title=_literal(report.title),
        identifier=_literal(report.identifier),
        verdict=_literal(report.verdict),
        date=f"datetime(year: {day.year}, month: {day.month}, day: {day.day})",
        colour=colours[report.tone],
    )
    lines = []
    for chapter in report.chapters:
        lines.append(f"#heading(level: 2, {_literal(chapter.title)})")
        lines += [f"{_typst_block(one)}\n" for one in chapter.blocks]
    return head + "\n".join(lines)


def _literal(text: str) -> str:
    """A string literal; without control characters, JSON's escapes are those of typst."""
    return json.dumps("".join(sign if sign.isprintable() else " " for sign in text), ensure_ascii=False)


def _typst_block(block: Block) -> str:
    match block:
        case Paragraph(text=text, is_strong=is_strong):
            return f"#strong({_literal(text)})" if is_strong else f"#par({_literal(text)})"
        case Facts(pairs=pairs):
            cells = ", ".join(
                f"text(fill: luma(90), {_literal(name)}), {_literal(value)}" for name, value in pairs
            )
            return f"#grid(columns: (48mm, 1fr), row-gutter: 5pt, {cells})"
        case Picture(svg=svg, caption=caption):
            alternative = _literal(caption)
            image = f'image(bytes({_literal(svg)}), format: "svg", width: 100%, alt: {alternative})'
            return f"#figure({image}, caption: {alternative}, numbering: none)"
        case Table():
            return _typst_table(block)


def _typst_table(table: Table) -> str:
    count, first = len(table.columns), table.numbers_from
    widths = ["auto"] * count
    if first is None:  # the column with the longest text takes what the others leave
        longest = [max(map(len, column)) for column in zip(table.columns, *table.rows, strict=True)]
        widths[longest.index(max(longest))] = "1fr"
    align = ", ".join("left" if first is None or column < first else "right" for column in range(count))
    head = ", ".join(f"strong({_literal(name)})" for name in table.columns)
    cells = ", ".join(_literal(text) for row in table.rows for text in row)
    return f"#table(columns: ({', '.join(widths)}), align: ({align}), table.header({head}), {cells})"
