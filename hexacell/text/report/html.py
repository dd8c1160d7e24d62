"""A report as one HTML file: no other file, no script and no network is needed to read or print it."""

from __future__ import annotations

from html import escape

from hexacell.text.report.blocks import (
    Block,
    Chapter,
    Facts,
    Paragraph,
    Picture,
    Report,
    Table,
)

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


def html_of(report: Report) -> str:
    """The whole file; every text in it is escaped."""
    chapters = "\n".join(map(_chapter, report.chapters))
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
    return f'"{"".join(map(_css_sign, text))}"'


def _css_sign(sign: str) -> str:
    is_plain = sign.isascii() and (sign.isalnum() or sign in " ._-/")
    return sign if is_plain else f"\\{ord(sign):x} "


def _chapter(chapter: Chapter) -> str:
    blocks = "\n".join(map(_block, chapter.blocks))
    return f"<section>\n<h2>{escape(chapter.title)}</h2>\n{blocks}\n</section>"


def _block(block: Block) -> str:
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
            return _table(block)


def _table(table: Table) -> str:
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
