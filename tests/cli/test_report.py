"""``hexacell report``: what the page of a run says, and that it says it of that run alone."""

import hashlib
import json
import re
from collections.abc import Callable
from html import unescape
from math import hypot
from pathlib import Path
from typing import Any

import pytest

from procedures.journal.journal import encode, read_entries
from procedures.run.keys import Phase
from procedures.steps import events
from tests.mutations.journals import with_checksum

CHAPTERS = [
    "As found and as left", "What was corrected", "What it holds for", "Subject",
    "Statement of conformity", "How it was measured", "Uncertainty budget", "Identified geometry",
    "Records and residuals", "Conditions", "Instruments and traceability", "Files", "Authorisation",
]  # fmt: skip


def text_of(page: str) -> str:
    without = re.sub(r"<(style|title)\b.*?</\1>", "", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", without)).split())


def test_the_page_says_what_the_run_found_the_verdict_first(typed_here, demo, run) -> None:
    outcome = typed_here("report", run, "--json")
    assert outcome.code == 0, outcome.err
    page = (run / "report.html").read_text()
    assert re.findall(r"<h2>(.*?)</h2>", page) == CHAPTERS
    said, verified = text_of(page), demo.outcome.document["verification"]
    assert said.index("PASS") < said.index("Statement of conformity")
    error = verified["accuracy"]["position"]
    first, _, others = said.partition("Statement of conformity")
    assert f"{error['value']:.3f} mm U {error['expanded']:.3f} mm, limit 0.3 mm: pass" in first
    assert "SIMULATED" in first
    assert all(name in first for name in (run.name, "encoder of leg 6: 1006", "Teach anew"))
    assert "SIMULATED" in others
    assert f"{verified['before_mm']:.3f} {verified['after_mm']:.3f}" in said
    assert "it was not checked" in said
    digest = hashlib.sha256((run / "journal.jsonl").read_bytes()).hexdigest()
    assert f"journal.jsonl {digest}" in said
    assert outcome.document["identifier"] == f"simulated-hexaglide / {run.name} / {digest[:12]}"
    assert outcome.document["identifier"] in said
    closed = next(
        one.event for one in read_entries(run / "journal.jsonl") if isinstance(one.event, events.SetClosed)
    )
    drift = f"{max(map(abs, closed.drift_mm)):.3f}"
    assert re.search(rf"\bpoint 1 17 [\d.]+ {drift} point 2 17 ", said)
    for parameter in json.loads((run / "result.json").read_text())["parameters"]:
        is_free = parameter["sigma"] > 0.0
        assert (re.search(rf"\b{parameter['name']} mm -?\d", said) is not None) == is_free


def test_every_measured_deviation_and_change_is_said_where_it_is_drawn(typed_here, run) -> None:
    assert typed_here("report", run).code == 0
    page = (run / "report.html").read_text()
    said = [unescape(one) for one in re.findall(r"<g><title>(.*?)</title>", page)]
    entries = [one.event for one in read_entries(run / "journal.jsonl")]
    after = next(one for one in entries if isinstance(one, events.RecordTaken) and is_held_out(one))
    size = hypot(*after.deviation_mm)
    assert any(f"{size:.3f} mm (x {after.deviation_mm[0]:+.3f}, " in one for one in said)
    result = json.loads((run / "result.json").read_text())
    for parameter in result["parameters"]:
        if parameter["sigma"]:
            assert any(
                one.startswith(parameter["name"]) and f"{parameter['value']:.3f}" in one for one in said
            )


def is_held_out(record: events.RecordTaken) -> bool:
    return record.at.phase is Phase.AFTER and record.orientation == 2


def test_the_budget_adds_up_and_the_noise_is_compared_in_one_unit(typed_here, run) -> None:
    """Also where a cause is largest at another pose than all together."""
    file = run / "result.json"
    result = json.loads(file.read_text())
    budget = result["uncertainty"]
    budget["lines"][0] |= {"part_mm": 0.04, "size": 1.0, "combined_mm": 9.0}
    budget["lines"][1] |= {"part_mm": 0.0003, "size": 1.0}
    budget["standard_mm"] = hypot(budget["noise_part_mm"], 0.04, 0.0003)
    file.write_text(json.dumps(result))
    assert typed_here("report", run).code == 0
    said = text_of((run / "report.html").read_text())
    table = re.search(r"part of u, mm (.*) U = ([\d.]+) mm = ([\d.]+) u", said)
    assert table is not None
    *parts, total = map(float, re.findall(r"\b\d\.\d{3}\b", table[1]))
    assert len(parts) == 3
    assert hypot(*parts) == pytest.approx(total, abs=0.001)
    assert float(table[2]) == pytest.approx(float(table[3]) * total, abs=0.002)
    gauge = result["noise"]["gauge_mm"]
    assert f"gauge, um {1e3 * gauge['stated']:.2f} {1e3 * gauge['estimated']:.2f} +- " in said


def test_it_is_the_same_again_and_changes_nothing_else(typed_here, run) -> None:
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    pages = set()
    for _ in range(2):
        assert typed_here("report", run).code == 0
        pages.add((run / "report.html").read_bytes())
    assert len(pages) == 1
    assert {path: path.read_bytes() for path in before} == before
    assert sum(path.is_file() for path in run.rglob("*")) == len(before) + 1


def test_a_pdf_is_written_where_it_is_wanted(typed_here, run, tmp_path) -> None:
    assert typed_here("report", run, "--output", tmp_path / "r.pdf").code == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")
    assert not (run / "report.html").exists()


def test_two_runs_are_compared(typed_here, demo, run, tmp_path) -> None:
    assert typed_here("report", run, "--compare", demo.run).code == 0
    said = text_of((run / "report.html").read_text())
    assert f"Compared with {demo.run.name} of " in said
    assert "The noise of both runs explains all changes together." in said


def forge(run: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the event with which the run began; its checksum is right."""
    first, *others = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    record = json.loads(first)
    change(record["event"])
    del record["crc"]
    (run / "journal.jsonl").write_bytes(with_checksum(record) + b"".join(others))


def test_a_run_of_the_quick_level_is_not_compared(typed_here, demo, run) -> None:
    """Its geometry has the errors of the result that it started from."""
    forge(run, lambda started: started.update(mode="quick"))
    outcome = typed_here("report", run, "--compare", demo.run)
    assert (outcome.code, "identified no geometry of its own" in outcome.err) == (2, True)


def test_an_interrupted_run_has_no_verdict(typed_here, run) -> None:
    entries = list(read_entries(run / "journal.jsonl"))
    first = next(n for n, one in enumerate(entries) if isinstance(one.event, events.SetClosed))
    (run / "journal.jsonl").write_bytes(b"".join(encode(one) for one in entries[: first + 1]))
    (run / "result.json").unlink()
    assert typed_here("report", run).code == 0
    said = text_of((run / "report.html").read_text())
    assert "NOT EVALUATED" in said
    assert "The run ended before anything could be said of the robot." in said
    assert "Nothing was written: the robot is left as it was found." in said


def test_an_expired_certificate_stands_in_it(typed_here, run) -> None:
    cell = run / "cell.toml"
    gauge = 'name = "x"\naxis = "x"\n'
    stated = f'{gauge}certificate = {{number = "D-K <17>", due = "2020-01-01"}}\n'
    cell.write_text(cell.read_text().replace(gauge, stated, 1))
    assert typed_here("report", run).code == 0
    said = text_of((run / "report.html").read_text())
    assert "D-K <17> 2020-01-01: EXPIRED" in said
    assert "Expired on the day of the run: gauge x." in said


def test_what_has_no_report_is_refused(typed_here, run, short_cell) -> None:
    always = '\n[unattended]\nquiet_hours = ["00:00-12:00", "12:00-00:00"]\n'
    short_cell.cell.write_text(short_cell.cell.read_text() + always)
    typed_here("run", short_cell.cell, "--unattended")
    [night] = short_cell.runs()
    for arguments, words in (
        ((night,), "this run never began"),
        (("nowhere",), "this is no run folder"),
        ((short_cell.cell,), "this is no run folder"),
        ((run, "--output", run.with_name("report.PDF.txt")), "reports of this kind are not made"),
    ):
        refused = typed_here("report", *arguments)
        assert (refused.code, words in refused.err) == (2, True)


def test_a_damaged_result_is_told(typed_here, run) -> None:
    (run / "result.json").write_text("{")
    outcome = typed_here("report", run)
    assert outcome.code == 2
    assert "result.json: is damaged" in outcome.err


def test_a_forged_journal_is_told(typed_here, run) -> None:
    """Its geometry is that of no robot."""
    forge(run, lambda started: started["controller"].update(B=[[1.0], [2.0, 3.0]]))
    outcome = typed_here("report", run)
    assert outcome.code == 2
    said = " ".join(outcome.err.split())
    assert "journal.jsonl:1: this line of the journal cannot be of this run: a geometry has other" in said
    assert not (run / "report.html").exists()


def test_the_first_page_has_the_robot_with_its_errors_as_found_and_as_left(typed_here, run) -> None:
    assert typed_here("report", run).code == 0
    page = (run / "report.html").read_text()
    first = page[page.index('<figure class="robot">') :]
    first = first[: first.index("</figure>")]
    shown = text_of(first)
    assert re.search(
        r"The robot at X.*, 20 times as far: as found \(brown\), up to [45]\.\d+ mm and as left", shown
    )
    drawing = first[first.index("<svg") : first.index("</svg>")]
    assert {"#b35806", "#2166ac"} <= set(re.findall(r"#[0-9a-f]{6}", drawing))
    assert sorted(re.findall(r">(\d)</text>", drawing)) == list("123456")
