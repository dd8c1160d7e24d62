"""``hexacell serve``: the results of a cell for other machines, by OPC UA."""

import argparse
import asyncio
import signal
import sys

from hexacell.cell.loader import Cell
from hexacell.cell.operation import OpcUaSettings
from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.preflight import is_loopback

STOPS = (signal.SIGINT, signal.SIGTERM)


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; runs are only read."""
    cell = cell_at(options.cell, console)
    settings = cell.settings.opcua
    if settings is None:
        raise UsageError("its results are not served", subject=cell.path, action="Write [opcua] into it")
    if not is_loopback(settings.host):
        console.warn(f"who reaches {settings.host}:{settings.port} with the password can read results")
    if settings.anonymous:
        console.warn("anybody who reaches the server can read results: anonymous = true in [opcua]")
    asyncio.run(_serve(cell, settings, console))
    return ExitCode.DONE


async def _serve(cell: Cell, settings: OpcUaSettings, console: Console) -> None:
    try:
        from hexacell.result_server.server import serve_results  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise UsageError("asyncua is not installed", action="Install hexacell[opcua]") from error
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in STOPS:
        loop.add_signal_handler(number, stop.set)

    def ready(address: str) -> None:
        print(f"serving {address}; Ctrl-C ends it", file=sys.stderr, flush=True)

    try:
        await serve_results(cell, settings, stop, ready, console.warn)
    finally:
        for number in STOPS:
            loop.remove_signal_handler(number)
