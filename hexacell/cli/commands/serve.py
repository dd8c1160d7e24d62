"""``hexacell serve`` and ``simulate``: results by OPC UA, or a simulated cell, for other processes."""

import argparse
import asyncio
import signal
import sys
from collections.abc import Awaitable, Callable

from hexacell.cell.loader import Cell
from hexacell.cell.operation import OpcUaSettings
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.preflight import is_loopback
from hexacell.services.run.demo import require_simulation, served_cell
from hexacell.storage.atomic_files import write_atomically

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def results(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; runs are only read."""
    cell = cell_at(options.cell, console)
    settings = cell.settings.opcua
    if settings is None:
        raise UsageError("its results are not served", subject=cell.path, action="Write [opcua] into it")
    if not is_loopback(settings.host):
        console.warn(f"who reaches {settings.host}:{settings.port} with the password can read results")
    if settings.anonymous:
        console.warn("anybody who reaches the server can read results: anonymous = true in [opcua]")
    asyncio.run(_until_stopped(lambda stop: _serve_results(cell, settings, console, stop)))
    return ExitCode.DONE


async def _serve_results(
    cell: Cell, settings: OpcUaSettings, console: Console, stop: asyncio.Event
) -> None:
    try:
        from hexacell.result_server.server import serve_results  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise UsageError("asyncua is not installed", action="Install hexacell[opcua]") from error
    await serve_results(cell, settings, stop, lambda address: _announce(f"serving {address}"), console.warn)


def simulate(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; stdout gets a cell file with the addresses of the served devices."""
    cell = require_simulation(cell_at(options.cell, console))
    if options.output is not None:
        own = {path.resolve() for path in (cell.path, *cell.config_paths)}
        if options.output.resolve() in own:
            problem = f"--output {options.output} is a file of the simulated cell"
            raise UsageError(problem, action="Name another file")
    asyncio.run(_until_stopped(lambda stop: _serve_cell(cell, options, stop)))
    return ExitCode.DONE


async def _serve_cell(cell: Cell, options: argparse.Namespace, stop: asyncio.Event) -> None:
    with served_cell(cell) as text:
        if options.output is None:
            print(text, flush=True)
        else:
            write_atomically(options.output, text.encode())
        _announce("serving")
        await stop.wait()


async def _until_stopped(serve: Callable[[asyncio.Event], Awaitable[None]]) -> None:
    """Serve until a signal sets the event, whichever thread it comes to; what is ignored stays so."""
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    heeded = [number for number in STOPS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in heeded:
        loop.add_signal_handler(number, stop.set)
    try:
        await serve(stop)
    finally:
        for number in heeded:
            loop.remove_signal_handler(number)


def _announce(what: str) -> None:
    print(f"{what}; Ctrl-C ends it", file=sys.stderr, flush=True)
