"""``hexacell study ... --scheduler``: the same results from a cluster as from processes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hexacell.errors import ExitCode
from tests.dask_processes import DaskProcesses, dask_processes
from tests.waiting import wait_until

PAPER = ("study", "paper", "--draws", "1")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[DaskProcesses]:
    """Three workers, which run from the start."""
    (tmp_path / "cluster").mkdir()
    with dask_processes(tmp_path / "cluster", 3) as processes:
        wait_until(lambda: all("Registered to" in processes.said_by_worker(number) for number in range(3)))
        yield processes


def results(folder: Path) -> list[str]:
    path = folder / "paper.jsonl"
    return path.read_text().splitlines() if path.exists() else []


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_results_are_those_of_processes_though_a_worker_is_killed(
    start, typed, cluster, tmp_path: Path
) -> None:
    study = start(*PAPER, "--scheduler", cluster.address, "--folder", "dask", "--json")
    study.wait_until(lambda: len(results(tmp_path / "dask")) >= 3, "results")
    cluster.workers[0].kill()
    on_dask = study.ended()
    by_processes = typed(*PAPER, "--processes", "2", "--folder", "processes", "--json")
    assert (on_dask.code, by_processes.code) == (0, 0), on_dask.err
    assert on_dask.document == by_processes.document
    kept = sorted(results(tmp_path / "dask"))
    assert kept == sorted(results(tmp_path / "processes"))
    assert len(kept) == len({json.loads(line)["key"] for line in kept}) == 21


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--scheduler", "here"), "'here' is not an address of a Dask scheduler. Try tcp://HOST:8786"),
        (("--scheduler", "tcp://h:1", "--processes", "2"), "not allowed with argument --scheduler"),
    ],
)
def test_what_cannot_be_is_refused(typed_here, arguments, words: str) -> None:
    refused = typed_here(*PAPER, *arguments)
    assert (refused.code, words in refused.err) == (ExitCode.USAGE, True), refused.err


def test_dask_may_be_absent(typed_here, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "hexacell.study.dask_cluster", None)
    refused = typed_here(*PAPER, "--scheduler", "tcp://127.0.0.1:1")
    assert refused.code == ExitCode.USAGE
    assert "Dask is not installed. Install hexacell[dask]" in refused.err
