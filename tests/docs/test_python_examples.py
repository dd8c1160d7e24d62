"""The notebook and the examples in Python of the pages do what they show, in the order in which they stand.

Their cells are run as a notebook runs them, ``await`` at the top included, on a loop that goes on: by a few
lines of our own, as Jupyter's would bring two dozen packages for the same.
"""

import ast
import inspect
import json
import re
from pathlib import Path
from types import CodeType
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

from tests.cli.cell_folder import PATIENT, QUICK, copy_cell
from tests.docs.pages import ROOT

NOTEBOOK = json.loads((ROOT / "docs/notebook.ipynb").read_text(encoding="utf-8"))
CELLS = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
FENCE = re.compile(r"^```python\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)


async def value_of(cell: str, names: dict[str, Any]) -> Any:
    """Run a cell; what its last line gives if that is an expression."""
    *body, last = ast.parse(cell).body

    async def run(code: CodeType) -> Any:
        found = eval(code, names)
        return await found if inspect.iscoroutine(found) else found

    flags = ast.PyCF_ALLOW_TOP_LEVEL_AWAIT
    if not isinstance(last, ast.Expr):
        return await run(compile(ast.Module([*body, last], []), "cell", "exec", flags))
    await run(compile(ast.Module(body, []), "cell", "exec", flags))
    return await run(compile(ast.Expression(last.value), "cell", "eval", flags))


@pytest.fixture(autouse=True)
def place(tmp_path: Path, tmp_path_factory, monkeypatch) -> Path:
    """A folder to work in, one for short sockets and temporary files, and pictures without a screen."""
    runtime = tmp_path_factory.mktemp("r")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setattr("tempfile.tempdir", str(runtime))
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    monkeypatch.setattr(plt, "show", lambda: None)
    return tmp_path


async def test_the_notebook_calibrates_a_robot_from_nothing(capsys) -> None:
    names: dict[str, Any] = {"__name__": "__main__"}
    values = [await value_of(cell, names) for cell in CELLS]
    plt.close("all")
    assert sum(bool(line) for cell in CELLS for line in cell.splitlines()) <= 15
    assert names["result"].verdict == "pass"
    assert sum("closed" in one or "point" in one for one in capsys.readouterr().out.splitlines()) > 5
    htmls = [value._repr_html_() for value in values if hasattr(value, "_repr_html_")]
    assert len(htmls) == 2, "devices and the result show themselves"
    assert "gauge x" in htmls[0]
    assert htmls[1].count("<svg") == 2
    assert values[-1][2].shape == (2, 2)


async def test_the_examples_of_the_page_work_one_after_the_other(place, monkeypatch) -> None:
    quick = place / "bundled"
    quick.mkdir()
    folder = copy_cell(quick)
    folder.edit(*QUICK, *PATIENT)
    monkeypatch.setattr("hexacell.services.run.demo.bundled_config", lambda _: folder.cell)
    names: dict[str, Any] = {"__name__": "__main__"}
    for example in FENCE.findall((ROOT / "docs/api.md").read_text(encoding="utf-8")):
        await value_of(example, names)
    plt.close("all")
    assert names["result"].verdict == "pass"
    assert (place / "errors.png").stat().st_size > 1000
    assert names["records"] == names["result"].records


@pytest.mark.parametrize("page", ["docs/interface.md", "README.md"])
def test_what_other_pages_name_is_there(page: str) -> None:
    from hexacell import api

    named = re.findall(r"\bapi\.(\w+)", (ROOT / page).read_text(encoding="utf-8"))
    assert named
    assert set(named) <= {*dir(api), "key", "md"}


def test_the_notebook_is_committed_without_outputs() -> None:
    assert all(not cell.get("outputs") for cell in NOTEBOOK["cells"])
