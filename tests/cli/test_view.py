"""``hexacell view``: one file that needs nothing else, with what the run measured; browsers show it."""

import json
import re
import shutil
import subprocess
import sys
import webbrowser
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from procedures.run.keys import Phase
from procedures.run.state import fold

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
SOFTWARE_GRAPHICS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")

WATCH = """<script>
const said = [];
addEventListener("error", (event) => said.push(event.message));
addEventListener("securitypolicyviolation", (event) => said.push(event.blockedURI));
console.error = (...words) => said.push(words.join(" "));
</script>"""
TELL = """<script>
document.getElementById("robot").on("plotly_animated", () => {
  const robot = document.getElementById("robot");
  document.body.dataset.told = JSON.stringify({
    said, names: robot.data.map((one) => one.name), title: document.title,
    pose: robot.layout.title.text, canvases: robot.querySelectorAll("canvas").length,
    fetched: performance.getEntriesByType("resource").map((one) => one.name),
  });
});
const at_once = {mode: "immediate", frame: {duration: 0, redraw: true}, transition: {duration: 0}};
Plotly.animate("robot", ["3"], at_once);
</script>"""
"""Put into a copy of the page: what it complains of, and what it shows after a change of the pose."""


@pytest.fixture(autouse=True)
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What would be opened in a browser."""
    found: list[str] = []

    def open_in_browser(url: str) -> bool:
        found.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", open_in_browser)
    return found


def traces_of(page: str) -> list[dict[str, Any]]:
    """The traces of a page, from the text that plotly is given."""
    start = re.search(r'Plotly\.newPlot\(\s*"robot",\s*', page)
    assert start is not None
    traces: list[dict[str, Any]] = json.JSONDecoder().raw_decode(page[start.end() :])[0]
    return traces


def places_of(trace: dict[str, Any]) -> np.ndarray:
    return np.array([trace[axis] for axis in "xyz"], dtype=float).T


def test_a_run_is_seen_with_what_it_planned_measured_and_changed(typed_here, demo, run, opened) -> None:
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    outcome = typed_here("view", run)
    assert outcome.code == 0, outcome.err
    assert opened == [(run / "view.html").as_uri()]
    assert {path: path.read_bytes() for path in before} == before
    page = (run / "view.html").read_text()
    assert f"<title>simulated-hexaglide / {run.name}: the robot</title>" in page
    assert "default-src 'none'" in page
    assert not re.search(r"<(?:script|link|img)[^>]*(?:src|href)=", page)
    named = {trace["name"]: trace for trace in traces_of(page)}
    state = fold(demo.events())
    taken = [one for one in state.samples(Phase.BEFORE) if one.orientation > 1]
    name = next(name for name in named if name.startswith("held-out poses as found"))
    factor = float(re.search(r"errors ([\d.]+) times", name)[1])  # type: ignore[index]
    drawn = places_of(named[name]).reshape(-1, 3, 3)
    assert np.allclose(drawn[:, 0], [one.pose[:3] for one in taken], atol=1e-3)
    vectors = np.array([one.deviation_mm for one in taken])
    assert np.allclose(drawn[:, 1] - drawn[:, 0], factor * vectors, atol=1e-3)
    assert any(name.startswith("held-out poses as left: 21") for name in named)
    assert any(name.startswith("legs as found, differences") for name in named)
    assert typed_here("view", run, "--no-open").code == 0  # its own file is replaced
    assert len(opened) == 1


def test_a_cell_is_seen_as_it_is_now_in_a_page_or_a_picture(typed_here, cell_folder, opened) -> None:
    outcome = typed_here("view", cell_folder.cell, "--json")
    assert outcome.code == 0, outcome.err
    page = Path(outcome.document["view"])
    assert (page.parent, outcome.document["poses"]) == (cell_folder.cell.parent, 6)
    numbers = next(one for one in traces_of(page.read_text()) if one.get("text") == list("123456"))
    assert numbers["mode"] == "text"
    drawn = typed_here("view", cell_folder.cell, "--output", "robot.svg", "--no-open")
    assert drawn.code == 0
    assert Path("robot.svg").read_text().startswith("<svg ")
    assert opened == []


def test_what_cannot_be_shown_is_told_in_a_line(typed_here, cell_folder, run, monkeypatch, tmp_path):
    refused = typed_here("view", cell_folder.cell, "--output", "robot.png", "--no-open")
    assert (refused.code, "ends in .html or .svg" in refused.err) == (2, True)
    absent = typed_here("view", tmp_path / "absent.toml", "--no-open")
    assert (absent.code, "absent.toml" in absent.err) == (2, True)
    empty = typed_here("view", tmp_path, "--no-open")
    assert (empty.code, "no run folder" in empty.err) == (2, True)
    monkeypatch.setitem(sys.modules, "plotly", None)
    missing = typed_here("view", run, "--no-open")
    assert (missing.code, "Install hexacell[view]" in missing.err) == (2, True)
    assert not (run / "view.html").exists()


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium to open the page in")
def test_the_page_runs_in_a_browser_without_a_network(typed_here, run, tmp_path) -> None:
    assert typed_here("view", run, "--no-open").code == 0
    page, watched = (run / "view.html").read_text(), tmp_path / "watched.html"
    watched.write_text(page.replace("<head>", f"<head>{WATCH}", 1).replace("</body>", f"{TELL}</body>"))
    browser = [str(CHROMIUM), "--headless", "--no-sandbox", f"--user-data-dir={tmp_path / 'profile'}"]
    shown = subprocess.run(
        [*browser, *SOFTWARE_GRAPHICS, "--virtual-time-budget=20000", "--dump-dom", watched.as_uri()],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=True,
        timeout=300.0,
    ).stdout
    told = re.search(r'data-told="([^"]*)"', shown)
    assert told is not None, "the pose was not changed"
    found = json.loads(unescape(told[1]))
    assert found["said"] == []
    assert found["fetched"] == []
    assert found["title"].startswith("simulated-hexaglide / ")
    assert found["names"] == [one["name"] for one in traces_of(page)]
    assert found["pose"].endswith("the robot at X80.000 Y-80.000 Z500.000 A0.000 B15.000 C10.000")
    assert found["canvases"] > 0
