"""A figure that misses its target, is of another commit, or did not come, is told; none is lost."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.benchmarks.figures import (
    DID_NOT_END,
    NEVER,
    Figure,
    Figures,
    at_least,
    at_most,
    between,
    keep,
    read,
    table,
)
from tests.benchmarks.samples import SAMPLES, samples

SPEED = Figure(
    "tests/benchmarks/test_speed.py::test_a[x]", "time", 2.5, "s", "at most 2", False, "new", "", "2 cores"
)


def test_a_target_holds_within_its_limits() -> None:
    assert at_most(2).holds(2.0)
    assert between(0.9, 1.1).holds(1.0)
    for target, value in ((at_most(2), 2.1), (at_least(2), 1.9), (NEVER, 1.0), (at_most(2), math.nan)):
        assert not target.holds(value)


def test_a_pass_keeps_figures_of_other_benchmarks_and_replaces_its_own(tmp_path: Path) -> None:
    file = tmp_path / "build" / "figures.json"
    old = replace(SPEED, benchmark="tests/benchmarks/test_check.py::test_b", commit="old")
    did_not_end = replace(SPEED, name=DID_NOT_END, met=None, commit="old")
    for one in (old, replace(SPEED, value=9.0, commit="old"), did_not_end, SPEED):
        keep(one, file)
    assert read(file) == [old, SPEED]
    figures = Figures("tests/benchmarks/test_x.py::test_x", "x", [], file)
    figures("kept", 1, "mm", at_most(2.0))
    figures("missed", 3.0, "mm", at_most(2.0))
    assert figures.missed == ["missed: 3 mm (at most 2)"]
    assert [one.met for one in read(file)][-2:] == [True, False]


def test_the_table_says_what_is_missed_and_of_which_commit_it_is() -> None:
    old = replace(SPEED, name="older", value=1.0, met=True, commit="old")
    ended = replace(SPEED, name=DID_NOT_END, value="ConvergenceError", target="", met=None)
    text = table([SPEED, old, ended, replace(SPEED, target="", met=None)], "new")
    assert "| speed x | time | 2.5 s | at most 2 | **missed** |" in text
    assert "| speed x | older | 1 s | at most 2 | at old |" in text
    assert f"| speed x | {DID_NOT_END} | ConvergenceError s |  | **missed** |" in text
    assert "4 figures, 3 of them with a target, of which 2 were missed" in text


def test_full_takes_the_samples_of_the_targets(monkeypatch: pytest.MonkeyPatch) -> None:
    few, many = SAMPLES["check"]["RUNS"]
    monkeypatch.delenv("RUNS", raising=False)
    monkeypatch.setenv("FULL", "1")
    assert samples("tests.benchmarks.test_check") == {"RUNS": many}
    monkeypatch.setenv("FULL", "0")
    assert samples("check") == {"RUNS": few}
    monkeypatch.setenv("RUNS", "3")
    assert samples("check") == {"RUNS": 3}
