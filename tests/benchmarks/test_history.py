"""The history of a cell with 10,000 runs: how long it takes to open."""

import time
from pathlib import Path

from hexacell.runs.archive import INDEX
from hexacell.runs.run_folder import runs_folder
from hexacell.services.history.past_runs import past_runs
from tests.benchmarks.figures import Figures, at_most
from tests.hexacell.services.proposed_runs import a_cell, propose_run

RUNS = 10_000
LIMIT_S = 0.5


def test_a_long_history_opens_at_once(tmp_path: Path, figure: Figures) -> None:
    cell = a_cell(tmp_path)
    journal = propose_run(cell, "0").folder.journal.read_bytes()
    for number in range(1, RUNS):
        folder = runs_folder(cell) / str(number)
        folder.mkdir()
        (folder / "journal.jsonl").write_bytes(journal)
    began = time.perf_counter()
    assert len(past_runs(cell)) == RUNS
    made = time.perf_counter() - began
    opened = min(seconds_to_open(cell) for _ in range(3))
    size = (runs_folder(cell) / INDEX).stat().st_size / RUNS
    figure(f"history of {RUNS} runs: opened, best of three", opened, "s", at_most(LIMIT_S))
    figure("  without an archive, journals of 5 lines", made, "s")
    figure("  the archive takes, a run", size, "bytes")


def seconds_to_open(cell) -> float:
    began = time.perf_counter()
    past_runs(cell)
    return time.perf_counter() - began
