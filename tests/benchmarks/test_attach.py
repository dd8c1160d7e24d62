"""How soon a run in a process of its own can be left, whatever it is doing."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.loader import Cell
from hexacell.run_process.client import start_host
from hexacell.run_process.messages import EventRecorded, HostMessage
from hexacell.run_process.run_socket import socket_path
from hexacell.runs.run_folder import RunFolder, runs_folder
from procedures.steps import events
from procedures.steps.identify import Identify
from procedures.steps.judge import Judge
from procedures.steps.move import Move
from procedures.steps.sample import Sample
from tests.benchmarks.figures import at_most
from tests.cli.test_host import hosts_of
from tests.hexacell.services.proposed_runs import a_cell
from tests.waiting import until

QUIT_S = 0.5
"""What leaving may take until nothing is left."""


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cell:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return a_cell(tmp_path)


def is_step(kind: type[Any], word: str = "") -> Callable[[HostMessage], bool]:
    def holds(message: HostMessage) -> bool:
        event = message.event if isinstance(message, EventRecorded) else None
        step = event.step if isinstance(event, events.StepBegun) else None
        return isinstance(step, kind) and (getattr(step, "orientation", 3) == 3) and word in step.kind

    return holds


STAGES: dict[str, Callable[[HostMessage], bool]] = {
    "connecting": lambda _: True,
    "moving": is_step(Move),
    "taking a record": is_step(Sample),
    "identifying": is_step(Identify),
    "judging": is_step(Judge),
}


@pytest.mark.parametrize("stage", STAGES)
async def test_leaving_leaves_nothing_within_half_a_second(cell, figure, stage: str) -> None:
    folder = RunFolder(runs_folder(cell) / "run").path
    arguments = [str(cell.path), "--folder", str(folder), "--mode", "optimise"]
    connection = await start_host(socket_path(cell), arguments)
    async for message in connection.messages():
        if STAGES[stage](message):
            break
    begin = time.perf_counter()
    await connection.leave(keep_running=False)
    returned = time.perf_counter() - begin
    await until(lambda: not hosts_of(cell) and not socket_path(cell).exists())
    gone = time.perf_counter() - begin
    figure(f"leaving while {stage}: back after", returned, "s", at_most(QUIT_S))
    figure("  nothing is left after", gone, "s")
