"""``docs/glossary.md`` names what there is: every symbol in the file beside it, every path in the docs."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
QUOTED = re.compile(r"`([^`]+)`")
SYMBOL = re.compile(r"`((?:hexacell|drivers|procedures)(?:\.[a-z_0-9]+)+)\.([A-Z]\w+)`")
PATH = re.compile(r"`((?:hexacell|drivers|procedures|tests|docs|configs)/[\w./-]*)`")


def rows() -> list[tuple[list[str], list[str]]]:
    """The code names of each row of the glossary, and the files beside them."""
    table = (ROOT / "docs" / "glossary.md").read_text().splitlines()
    cells = [line.strip("| ").split(" | ") for line in table if line.startswith("| ") and "`" in line]
    return [(QUOTED.findall(row[2]), QUOTED.findall(row[3])) for row in cells]


def defined(path: str) -> set[str]:
    """Names that a file defines: ``name`` at its top, ``Class.name`` in a class."""
    return set(names(ast.parse((ROOT / path).read_text()).body))


def names(body: list[ast.stmt], prefix: str = "") -> Iterator[str]:
    for node in body:
        match node:
            case ast.ClassDef():
                yield prefix + node.name
                yield from names(node.body, f"{prefix}{node.name}.")
                yield from (f"{prefix}{node.name}.{name}" for name in instance_attributes(node))
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                yield prefix + node.name
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield prefix + name
            case ast.Assign():
                yield from (prefix + target.id for target in node.targets if isinstance(target, ast.Name))


def instance_attributes(node: ast.ClassDef) -> Iterator[str]:
    """Names that methods assign to ``self``."""
    for part in ast.walk(node):
        match part:
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                yield name


@pytest.mark.parametrize(("symbols", "files"), rows(), ids=lambda value: value[0])
def test_every_name_is_in_the_file_beside_it(symbols: list[str], files: list[str]) -> None:
    found = set().union(*map(defined, files))
    assert set(symbols) <= found


def test_no_term_has_two_rows() -> None:
    symbols = [symbol for symbols, _ in rows() for symbol in symbols]
    assert len(symbols) > 60
    assert sorted(symbols) == sorted(set(symbols))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_path_that_a_page_names_exists(page: Path) -> None:
    missing = [path for path in PATH.findall(page.read_text()) if not (ROOT / path).exists()]
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_dotted_name_exists(page: Path) -> None:
    found = SYMBOL.findall(page.read_text())
    assert [pair for pair in found if pair[1] not in defined(pair[0].replace(".", "/") + ".py")] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []
