"""No two public functions or classes of the product have the same name."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

CHECKOUT = Path(__file__).parent.parent
PACKAGES = ("hexacell", "drivers", "procedures")
ONE_IDEA_IN_SEVERAL_MODULES = {
    "main": "a command of the command line",
    "parse_value": "a reading in the syntax of one gauge protocol",
}


def public_names(source: str) -> list[str]:
    """The public functions and classes at the top of a module."""
    definitions = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    nodes = [node for node in ast.parse(source).body if isinstance(node, definitions)]
    return [node.name for node in nodes if not node.name.startswith("_")]


def test_no_public_name_is_defined_twice() -> None:
    files = [path for package in PACKAGES for path in (CHECKOUT / package).rglob("*.py")]
    counts = Counter(name for path in files for name in set(public_names(path.read_text(encoding="utf-8"))))
    assert counts["write_atomically"] == 1
    assert {name for name, count in counts.items() if count > 1} == set(ONE_IDEA_IN_SEVERAL_MODULES)
