"""How well a study uses two processes: time with one over twice the time with two, in one run. On
a computer that does something else besides, two processes have less than two processors to themselves.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from hexacell.study.paper_simulation import PAPER
from hexacell.study.tasks import processes, run_study
from tests.benchmarks.figures import at_least
from tests.benchmarks.samples import sample

DRAWS = sample(__name__, "DRAWS")
PAIRS = sample(__name__, "PAIRS")
LEAST = 0.90


def seconds(folder: Path, count: int) -> float:
    begun = time.perf_counter()
    run_study(PAPER, folder / str(count), DRAWS, processes(count), lambda *_: None)
    return time.perf_counter() - begun


def results(folder: Path, count: int) -> list[str]:
    return sorted((folder / str(count) / "paper.jsonl").read_text().splitlines())


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two processors")
def test_two_processes_are_nearly_twice_as_fast(tmp_path: Path, figure) -> None:
    found = []
    for pair in range(PAIRS):
        one, two = (seconds(tmp_path / str(pair), count) for count in (1, 2))
        found.append(one / (2.0 * two))
        assert results(tmp_path / str(pair), 1) == results(tmp_path / str(pair), 2)
    for pair, efficiency in enumerate(found, start=1):
        figure(f"efficiency of two processes, {21 * DRAWS} tasks, time {pair}", efficiency)
    figure("  median", np.median(found), "", at_least(LEAST))
