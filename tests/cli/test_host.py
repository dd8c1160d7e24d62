"""A run in a process of its own: it outlives its terminal, and nothing of it outlives its end."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import CellBusy, ExitCode
from hexacell.run_process.client import HostConnection, RunFailed, connect_to_run, start_host
from hexacell.run_process.host import STOPPED
from hexacell.run_process.messages import EventRecorded, HostMessage, StatusChanged
from hexacell.run_process.run_socket import socket_path
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder, runs_folder
from procedures.engine.command_loop import Status
from procedures.engine.commands import Resume
from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.waiting import until, wait_until

NOON = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)

TERMINAL = """
import asyncio, sys
from pathlib import Path
from hexacell.run_process.client import start_host
from hexacell.run_process.messages import EventRecorded

async def watch():
    connection = await start_host(Path(sys.argv[1]), sys.argv[2:])
    async for message in connection.messages():
        if isinstance(message, EventRecorded):
            print(message.event.kind, flush=True)

asyncio.run(watch())
"""
"""A terminal in a process of its own, which can be killed."""


@pytest.fixture
def cell(quick_cell, tmp_path_factory, monkeypatch) -> Cell:
    runtime = tmp_path_factory.mktemp("r")  # the path of a socket must be short
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setenv("TMPDIR", str(runtime))
    return load_cell(quick_cell.cell)


@pytest.fixture
def run(cell) -> RunFolder:
    return RunFolder(runs_folder(cell) / "run")


def arguments(cell: Cell, run: RunFolder) -> list[str]:
    return [str(cell.path), "--folder", str(run.path), "--mode", "optimise"]


def hosts_of(cell: Cell) -> list[int]:
    """The processes that run the cell."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"host" in words and os.fsencode(cell.path) in words:
            found.append(int(folder.name))
    return found


def nothing_is_left(cell: Cell) -> bool:
    """No process, socket or temporary file, and the cell can be locked."""
    sockets, temporary = socket_path(cell).parent, Path(os.environ["XDG_RUNTIME_DIR"])
    if hosts_of(cell) or any(sockets.iterdir()) or list(temporary.iterdir()) != [sockets]:
        return False
    with suppress(CellBusy), cell_lock(cell.config_path):
        return True
    return False


async def until_told(connection: HostConnection, condition: Callable[[HostMessage], bool]) -> HostMessage:
    async for message in connection.messages():
        if condition(message):
            return message
    pytest.fail("the run is over")


def is_record(message: HostMessage) -> bool:
    return isinstance(message, EventRecorded) and isinstance(message.event, events.RecordTaken)


async def attached(cell: Cell) -> HostConnection:
    connection = await connect_to_run(socket_path(cell))
    assert connection is not None
    return connection


@pytest.mark.slow
async def test_a_computation_is_not_waited_for(cell, run) -> None:
    """The others are told, nothing is left, and the run is resumed where it was."""
    connection = await start_host(socket_path(cell), arguments(cell, run))
    other = await attached(cell)

    def is_identifying(message: HostMessage) -> bool:
        event = message.event if isinstance(message, EventRecorded) else None
        return isinstance(event, events.StepBegun) and event.step.key == "identify"

    await until_told(connection, is_identifying)
    await connection.leave(keep_running=False)
    assert [one async for one in other.messages()][-1] == STOPPED
    await until(lambda: nothing_is_left(cell))
    last = read_journal(run.journal)[-1]
    assert is_identifying(EventRecorded(sequence=1, at=NOON, event=last))
    again = await start_host(socket_path(cell), [*arguments(cell, run), "--resume"])
    await until_told(again, lambda one: isinstance(one, EventRecorded) and one.event.kind == "identified")
    await again.leave(keep_running=False)
    await until(lambda: nothing_is_left(cell))


def test_a_killed_terminal_is_replaced(cell, run) -> None:
    command = [sys.executable, "-c", TERMINAL, str(socket_path(cell)), *arguments(cell, run)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as terminal:
        output = terminal.stdout
        assert output is not None
        wait_until(lambda: output.readline() == "sampled\n")
        terminal.send_signal(signal.SIGKILL)
    assert len(hosts_of(cell)) == 1, "the run goes on in its process"
    wait_until(lambda: isinstance(read_journal(run.journal)[-1], events.Paused))
    before = read_journal(run.journal)
    asyncio.run(_carry_on(cell, before))
    wait_until(lambda: nothing_is_left(cell))
    history = read_journal(run.journal)
    assert history[: len(before)] == before
    assert isinstance(history[len(before)], events.Resumed)


async def _carry_on(cell: Cell, before: tuple[events.Event, ...]) -> None:
    """Attach, see that it is paused, resume it, see a further record, and end it."""
    connection = await attached(cell)
    told: list[events.Event] = []

    def is_paused(message: HostMessage) -> bool:
        if isinstance(message, EventRecorded):
            told.append(message.event)
        return message == StatusChanged(status=Status.PAUSED)

    messages = connection.messages()
    async for message in messages:
        if is_paused(message):
            break
    assert told == list(before)
    await connection.give(Resume())
    async for message in messages:
        if is_record(message):
            break
    await connection.leave(keep_running=False)


async def test_a_host_that_cannot_begin_says_why(cell, run) -> None:
    cell.path.write_text("nothing")
    with pytest.raises(RunFailed, match=str(cell.path)) as refusal:
        await start_host(socket_path(cell), arguments(cell, run))
    assert refusal.value.exit_code is ExitCode.USAGE
    await until(lambda: not hosts_of(cell))


async def test_a_terminated_host_ends_its_run_cleanly(cell, run) -> None:
    connection = await start_host(socket_path(cell), arguments(cell, run))
    await until_told(connection, is_record)
    (host,) = hosts_of(cell)
    os.kill(host, signal.SIGTERM)
    told = [one.event async for one in connection.messages() if isinstance(one, EventRecorded)]
    assert isinstance(told[-1], events.Interrupted)
    await until(lambda: nothing_is_left(cell))
