"""README is a page, the docs can be read, and no new word or page makes them too long unseen."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
KB = 1024


@pytest.mark.parametrize(("pages", "kilobytes"), [("README.md", 15), ("docs/*.md", 230)])
def test_the_pages_are_not_larger_than_they_may_be(pages: str, kilobytes: int) -> None:
    assert sum(path.stat().st_size for path in ROOT.glob(pages)) <= kilobytes * KB


@pytest.mark.parametrize(("page", "most"), [("README.md", 250), ("docs/glossary.md", 100)])
def test_a_page_has_no_more_lines_than_it_may(page: str, most: int) -> None:
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    assert len([line for line in lines if page == "README.md" or line.startswith("| ")]) <= most
