"""The site of README and docs: no warning, no link that leads nowhere, nothing fetched from elsewhere."""

import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ROOT = Path(__file__).parents[2]


def build(source: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """What ``make docs`` runs, for a source and into a folder."""
    options = ["--fail-on-warning", "--keep-going", "--quiet", "-d", str(site / ".doctrees")]
    command = [sys.executable, "-m", "sphinx", *options, "-c", str(source / "docs"), str(source), str(site)]
    return subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)


class Page(HTMLParser):
    """What a page loads, and how many formulas it has."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.formulas = 0
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        stated = {name: value for name, value in attrs if value is not None}
        self.formulas += tag == "math"
        if tag == "link" and stated.get("rel") in {"stylesheet", "icon", "preload"}:
            self.loaded.append(stated["href"])
        if tag in {"img", "script", "iframe", "source"} and "src" in stated:
            self.loaded.append(stated["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, made once."""
    folder = tmp_path_factory.mktemp("site")
    made = build(ROOT, folder)
    assert (made.returncode, made.stderr) == (0, "")
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    """Its pages by their files."""
    return {path: Page(path) for path in site.rglob("*.html") if "_static" not in path.parts}


@pytest.mark.slow
def test_every_page_is_made_with_its_formulas_and_docstrings(pages, site):
    made = {path.relative_to(site).as_posix() for path in pages}
    pages_of_docs = (f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))
    sources = {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", *pages_of_docs}
    assert {source.replace(".md", ".html") for source in sources} | {"index.html"} <= made
    assert pages[site / "docs/derivations.html"].formulas > 100
    assert "$" not in (site / "docs/derivations.html").read_text(encoding="utf-8").partition("<body>")[2]
    page = (site / "docs/api.html").read_text(encoding="utf-8")
    for name in ("hexacell.api.fit_measurements", "hexacell.api.Record", "drivers.interfaces.Gauge.read"):
        assert f'id="{name}"' in page


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(pages, site):
    loaded = {address for page in pages.values() for address in page.loaded}
    assert loaded
    assert {address for address in loaded if urlsplit(address).scheme or urlsplit(address).netloc} == set()
    styles = "".join(path.read_text(encoding="utf-8") for path in (site / "_static").glob("*.css"))
    assert "@import" not in styles
    assert "url(http" not in styles.replace(" ", "").replace('"', "")


def test_mistakes_in_a_page_are_errors(tmp_path):
    shutil.copytree(ROOT / "docs/_site", tmp_path / "docs/_site")
    shutil.copy(ROOT / "docs/conf.py", tmp_path / "docs")
    mistakes = "[a page](nowhere.md), [a heading](index.md#missing), $\\nosuchcommand$"
    (tmp_path / "docs/index.md").write_text(f"# A page\n\n{mistakes}\n")
    made = build(tmp_path, tmp_path / "site")
    assert made.returncode != 0
    assert all(told in made.stderr for told in ("nowhere.md", "missing", "nosuchcommand"))
