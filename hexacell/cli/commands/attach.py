"""``hexacell attach``, and ``run --detachable``: a plain terminal at a run in a process of its own."""

from __future__ import annotations

import argparse
import asyncio

from hexacell.cell.loader import Cell
from hexacell.cli.attached_terminal import AttachedTerminal
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.cli.terminal import is_interactive
from hexacell.errors import ExitCode, UsageError
from hexacell.run_process.client import HostConnection, connect_to_run, start_host
from hexacell.run_process.run_socket import socket_path
from hexacell.services.run.calibration_run import RunRequest


def main(options: argparse.Namespace) -> ExitCode:
    """Attach to the run of a cell."""
    console = Console()
    _require_terminal()
    return asyncio.run(_attach(cell_at(options.cell, console), console))


def run_detachable(request: RunRequest, console: Console) -> ExitCode:
    """Begin a run in a process of its own, and attach to it."""
    _require_terminal()
    return asyncio.run(_begin(request, console))


async def _attach(cell: Cell, console: Console) -> ExitCode:
    connection = await connect_to_run(socket_path(cell))
    if connection is None:
        raise UsageError(
            "no run of this cell goes on in a process of its own",
            subject=cell.path,
            action="Begin one with `hexacell run CELL --detachable` or `hexacell tui CELL`",
        )
    return await _at_terminal(connection, console)


async def _begin(request: RunRequest, console: Console) -> ExitCode:
    arguments = [str(request.cell.path), "--folder", str(request.folder.path), "--mode", request.mode.value]
    arguments += ["--resume"] if request.resume else []
    arguments += ["--length-check"] if request.length_check else []
    started = await start_host(socket_path(request.cell), arguments, request.removed)
    return await _at_terminal(started, console)


async def _at_terminal(connection: HostConnection, console: Console) -> ExitCode:
    return await AttachedTerminal(console, connection).run()


def _require_terminal() -> None:
    if not is_interactive():
        raise UsageError(
            "there is no terminal on stdin, at which somebody could answer",
            action="Run it at a terminal, or use `hexacell run --unattended`",
        )
