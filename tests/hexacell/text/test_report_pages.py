"""A report as HTML and as PDF/A: whole, the same each time, and nothing in it is taken for markup."""

from datetime import date
from html.parser import HTMLParser

import pytest

from hexacell.errors import UsageError
from hexacell.text.report import pages

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect width="9" height="9"/></svg>'


def report(text: str) -> pages.Report:
    blocks = (
        pages.Paragraph(text),
        pages.Paragraph(text, is_strong=True),
        pages.Facts(((text, text),)),
        pages.Table((text, text), ((text, text),)),
        pages.Picture(SVG, text),
    )
    return pages.Report(
        text, text, date(2026, 11, 23), text, pages.Tone.GOOD, (pages.Chapter(text, blocks),)
    )


class Reader(HTMLParser):
    """The tags and the text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    return reader


HOSTILE = [
    '</p><script>alert("1")</script>',
    '#read("/etc/passwd")',
    '"; } body { display: none',
    "\\u{41}$x$*_",
]


def test_hostile_texts_stay_texts_and_both_pages_need_nothing_else() -> None:
    for text in HOSTILE:
        page = pages.html_of(report(text))
        assert read(page).tags == read(pages.html_of(report("plain"))).tags
        assert "".join(read(page).text).count(text) >= 9
        assert pages.pdf_of(report(text)).startswith(b"%PDF")
    page = pages.html_of(report("a <b> & c"))
    assert page == pages.html_of(report("a <b> & c"))
    assert "default-src 'none'" in page
    assert not {"script", "link", "img", "iframe"} & set(read(page).tags)
    made = pages.pdf_of(report("a <b> & c"))
    assert made == pages.pdf_of(report("a <b> & c"))
    assert b"pdfaid:part>2<" in made.replace(b" ", b"")


def test_without_typst_the_way_to_it_is_told(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "typst", None)
    with pytest.raises(UsageError, match="a PDF needs the package typst") as refusal:
        pages.pdf_of(report("x"))
    assert "hexacell[pdf]" in (refusal.value.action or "")
