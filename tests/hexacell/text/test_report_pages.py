"""A report as HTML and as PDF/A: whole, the same each time, and nothing in it is taken for markup."""

import re
from dataclasses import replace
from datetime import date
from html.parser import HTMLParser

import pytest

from hexacell.errors import UsageError
from hexacell.text.report import charts, pages
from hexacell.verdict.decision import JudgedError, Verdict

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect width="9" height="9"/></svg>'


def report(text: str) -> pages.Report:
    blocks = (
        pages.Paragraph(text),
        pages.Paragraph(text, is_strong=True),
        pages.Facts(((text, text),)),
        pages.Table((text, text), ((text, text),)),
        pages.Picture(SVG, text, (text, text)),
    )
    chapters = (pages.Chapter(text, blocks),)
    card = charts.error_card(
        text, JudgedError(value=0.1, expanded=0.2, limit=0.3, verdict=Verdict.PASS), "mm"
    )
    return pages.Report(
        text, text, date(2026, 11, 23), text, pages.Tone.GOOD, text, (card,), chapters, chapters
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


def read_text(page: str) -> str:
    return "".join(read(re.sub(r"<style.*?</style>", "", page, flags=re.DOTALL)).text)


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


def test_a_simulated_robot_is_named_on_every_page_and_a_real_one_never() -> None:
    real = report("plain")
    simulated = replace(real, is_simulated=True, robot=pages.Picture(SVG, "the robot"))
    assert "SIMULATED" in read_text(pages.html_of(simulated))
    assert "SIMULATED" not in read_text(pages.html_of(real))
    assert pages.html_of(simulated).count(SVG) == pages.html_of(real).count(SVG) + 1
    assert pages.pdf_of(simulated) != pages.pdf_of(replace(simulated, is_simulated=False))


def test_a_pdf_begins_its_chapters_on_the_second_page_and_cuts_no_table_that_fits_on_one() -> None:
    short = replace(report("plain"), summary=())
    rows = tuple((str(number), "1.000") for number in range(40))
    tables = tuple(pages.Chapter("t", (pages.Table(("name", "mm"), rows),)) for _ in range(2))
    for chapters, number in ((short.chapters, 2), (tables, 3)):
        made = pages.pdf_of(replace(short, chapters=chapters))
        assert len(re.findall(rb"/Type\s*/Page\b", made)) == number


def test_a_chart_shows_each_value_where_it_is_and_says_it() -> None:
    sizes = (4.0, 0.04)
    series = {name: [charts.Mark(size, f"<{size} mm>")] for name, size in zip("ab", sizes, strict=True)}
    page = charts.chart(series, ["1"], "c", by_decades=True)
    assert page.series == ("a", "b")
    heights = [
        float(at) for at in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)" r="4"[^>]*/></g>', page.svg)
    ]
    ticks = dict(re.findall(r'y="([\d.]+)" text-anchor="end">([\d.]+)<', page.svg))
    places = {float(label): float(at) - 3.5 for at, label in ticks.items()}
    decade = places[0.1] - places[1.0]
    assert heights[1] - heights[0] == pytest.approx(2.0 * decade, abs=0.3)
    assert places[1.0] > heights[0] > places[10.0]
    assert "&lt;4.0 mm&gt;</title>" in page.svg


def test_without_typst_the_way_to_it_is_told(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "typst", None)
    with pytest.raises(UsageError, match="a PDF needs the package typst") as refusal:
        pages.pdf_of(report("x"))
    assert "hexacell[pdf]" in (refusal.value.action or "")
