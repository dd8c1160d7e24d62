"""How well a study uses two processes: time with one over twice the time with two, in one run.

``DRAWS`` in the environment says how many draws of each of 21 cases, ``PAIRS`` how often both are timed. On
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

pytestmark = pytest.mark.benchmark

DRAWS = int(os.environ.get("DRAWS", "20"))
PAIRS = int(os.environ.get("PAIRS", "3"))
LEAST = 0.90


def seconds(folder: Path, count: int) -> float:
    begun = time.perf_counter()
    run_study(PAPER, folder / str(count), DRAWS, processes(count), lambda *_: None)
    return time.perf_counter() - begun


def results(folder: Path, count: int) -> list[str]:
    return sorted((folder / str(count) / "paper.jsonl").read_text().splitlines())


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two processors")
def test_two_processes_are_nearly_twice_as_fast(tmp_path: Path, say) -> None:
    found = []
    for pair in range(PAIRS):
        one, two = (seconds(tmp_path / str(pair), count) for count in (1, 2))
        found.append(one / (2.0 * two))
        assert results(tmp_path / str(pair), 1) == results(tmp_path / str(pair), 2)
    told = ", ".join(f"{efficiency:.2f}" for efficiency in found)
    say(f"efficiency of two processes, {21 * DRAWS} tasks", told, f"median at least {LEAST:.2f}")
    assert np.median(found) >= LEAST
