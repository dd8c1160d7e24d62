"""How soon a run in a process of its own can be left, and what its watchers cost the recorder."""

from __future__ import annotations

import asyncio
import os
import shutil
import socket
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.run_process.client import HostConnection, connect_to_run, start_host
from hexacell.run_process.messages import EventRecorded, HostMessage, LiveSnapshot
from hexacell.run_process.run_socket import socket_path
from hexacell.runs.run_folder import RunFolder, runs_folder
from procedures.journal.journal import read_entries
from procedures.steps import events
from procedures.steps.identify import Identify
from procedures.steps.judge import Judge
from procedures.steps.move import Move
from procedures.steps.sample import Sample
from tests.benchmarks.figures import at_most
from tests.cli.test_host import hosts_of
from tests.waiting import until

QUIT_S = 0.5
"""What leaving may take until nothing is left."""

STUCK_CLIENTS, WATCHERS = 5, 5


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cell:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    source = load_cell(bundled_config("simulated-hexaglide"))
    for path in (source.path, source.config_path):
        shutil.copy(path, tmp_path)
    return load_cell(tmp_path / source.path.name)


async def begun(cell: Cell) -> HostConnection:
    folder = RunFolder(runs_folder(cell) / "run")
    return await start_host(
        socket_path(cell), [str(cell.path), "--folder", str(folder.path), "--mode", "optimise"]
    )


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
    connection = await begun(cell)
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


async def test_attaching_shows_a_running_run_at_once(cell, figure) -> None:
    first = await begun(cell)
    async for message in first.messages():
        if is_step(Identify)(message):
            break
    begin = time.perf_counter()
    second = await connect_to_run(socket_path(cell))
    assert second is not None
    told, caught_up = 0, 0.0
    async for message in second.messages():
        told += isinstance(message, EventRecorded)
        if not isinstance(message, EventRecorded) and told and not caught_up:
            caught_up = time.perf_counter() - begin
        if isinstance(message, LiveSnapshot):
            break
    shown = time.perf_counter() - begin
    figure("attaching: events told", told)
    figure("  caught up after", caught_up, "s", at_most(1.0))
    figure("  live after", shown, "s")
    await second.leave(keep_running=True)
    await first.leave(keep_running=False)


def pace(cell: Cell) -> float:
    """The median time from the event of a move to the next decided step, s: two lines of the journal."""
    entries = read_entries(RunFolder(runs_folder(cell) / "run").journal)
    waits = [
        after.monotonic_s - before.monotonic_s
        for before, after in pairwise(entries)
        if isinstance(before.event, events.Arrived) and isinstance(after.event, events.StepBegun)
    ]
    return median(waits)


@pytest.mark.parametrize("watched", [False, True], ids=["alone", "watched"])
async def test_watchers_do_not_delay_the_recorder(cell, figure, watched: bool) -> None:
    connection = await begun(cell)
    stuck: list[socket.socket] = []
    watchers: list[asyncio.Future[int]] = []
    if watched:
        for _ in range(STUCK_CLIENTS):
            one = socket.socket(socket.AF_UNIX)
            one.connect(os.fspath(socket_path(cell)))
            stuck.append(one)
        for _ in range(WATCHERS):
            other = await connect_to_run(socket_path(cell))
            assert other is not None
            watchers.append(asyncio.ensure_future(_count(other)))
    told = await _count(connection)
    for one in stuck:
        one.close()
    counts = [await one for one in watchers]
    name = "with 5 watchers and 5 stuck ones" if watched else "alone"
    figure(f"{name}: events told", told)
    figure(f"{name}: from an arrival to the next step", 1e3 * pace(cell), "ms")
    assert counts == [told] * len(counts), "events are lost by nobody"


async def _count(connection: HostConnection) -> int:
    return sum([isinstance(one, EventRecorded) async for one in connection.messages()])
