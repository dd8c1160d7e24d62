"""A report as PDF/A-2b, typeset by typst (an optional package), the same byte for byte each time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Final

from hexacell.errors import UsageError
from hexacell.text.report.blocks import (
    Block,
    Chapter,
    Facts,
    Paragraph,
    Picture,
    Report,
    Table,
    Tone,
)

STANDARD: Final = "a-2b"

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

COLOURS = {Tone.GOOD: 'rgb("#1b7837")', Tone.BAD: 'rgb("#b2182b")', Tone.OPEN: 'rgb("#b8860b")'}


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
        typst_of(report).encode(), format="pdf", pdf_standards=STANDARD, ignore_system_fonts=True
    )


def typst_of(report: Report) -> str:
    """The markup of a report; every text is a string literal, so that none is taken for markup."""
    day = report.issued
    head = PREAMBLE.format(
        title=_text(report.title),
        identifier=_text(report.identifier),
        verdict=_text(report.verdict),
        date=f"datetime(year: {day.year}, month: {day.month}, day: {day.day})",
        colour=COLOURS[report.tone],
    )
    return head + "\n".join(line for chapter in report.chapters for line in _chapter(chapter))


def _text(text: str) -> str:
    """A string literal; without control characters, JSON's escapes are those of typst."""
    return json.dumps("".join(sign if sign.isprintable() else " " for sign in text), ensure_ascii=False)


def _chapter(chapter: Chapter) -> Iterator[str]:
    yield f"#heading(level: 2, {_text(chapter.title)})"
    for block in chapter.blocks:
        yield _block(block) + "\n"


def _block(block: Block) -> str:
    match block:
        case Paragraph(text=text, is_strong=is_strong):
            return f"#strong({_text(text)})" if is_strong else f"#par({_text(text)})"
        case Facts(pairs=pairs):
            cells = ", ".join(
                f"text(fill: luma(90), {_text(name)}), {_text(value)}" for name, value in pairs
            )
            return f"#grid(columns: (48mm, 1fr), row-gutter: 5pt, {cells})"
        case Picture(svg=svg, caption=caption):
            alternative = _text(caption)
            image = f'image(bytes({_text(svg)}), format: "svg", width: 100%, alt: {alternative})'
            return f"#figure({image}, caption: {alternative}, numbering: none)"
        case Table():
            return _table(block)


def _table(table: Table) -> str:
    count = len(table.columns)
    first = table.numbers_from
    widths = ", ".join(["auto"] * count if first is not None else _text_widths(table))
    align = ", ".join("left" if first is None or column < first else "right" for column in range(count))
    head = ", ".join(f"strong({_text(name)})" for name in table.columns)
    cells = ", ".join(_text(text) for row in table.rows for text in row)
    return f"#table(columns: ({widths}), align: ({align}), table.header({head}), {cells})"


def _text_widths(table: Table) -> list[str]:
    """The column with the longest text takes what the others leave."""
    longest = [max(map(len, column)) for column in zip(table.columns, *table.rows, strict=True)]
    widest = longest.index(max(longest))
    return ["1fr" if column == widest else "auto" for column in range(len(longest))]
