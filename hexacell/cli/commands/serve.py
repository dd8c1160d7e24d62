"""``hexacell serve``, ``simulate`` and ``tui --serve``: results, a simulated cell, the screen."""

import argparse
import asyncio
from collections.abc import Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Any

from hexacell.cell.loader import Cell
from hexacell.cell.operation import ScreenSettings
from hexacell.cell.passwords import stated_login
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.preflight import is_loopback
from hexacell.services.run.demo import require_simulation, served_cell
from hexacell.storage.output_files import SERVED_MARK


def results(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; runs are only read."""
    cell = cell_at(options.cell, console)
    if (settings := cell.settings.opcua) is None:
        raise UsageError("its results are not served", subject=cell.path, action="Write [opcua] into it")
    if not is_loopback(settings.host):
        console.warn(f"who reaches {settings.host}:{settings.port} with the password can read results")
    if settings.anonymous:
        console.warn("anybody who reaches the server can read results: anonymous = true in [opcua]")
    try:
        from hexacell.result_server.server import serve_results  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise UsageError("asyncua is not installed", action="Install hexacell[opcua]") from error
    served = serve_results(cell, settings, lambda at: _announce(f"serving {at}"), console.warn)
    return _until_stopped(served)


def simulate(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; stdout gets a cell file with the addresses of the served devices."""
    return _until_stopped(_serve_cell(require_simulation(cell_at(options.cell, console)), options))


async def _serve_cell(cell: Cell, options: argparse.Namespace) -> None:
    with served_cell(cell) as text:
        if options.output is None:
            Console().print(text)
        else:
            options.output.write(SERVED_MARK + text.encode())
        _announce("serving")
        await asyncio.Event().wait()


SCREEN_VARIABLES = {"user": "HEXACELL_SCREEN_USER", "password": "HEXACELL_SCREEN_PASSWORD"}


def screen(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; without a cell file the pages have the assistant that makes one."""
    path: Path = options.cell
    settings = cell_at(path, console).settings.screen if path.exists() else ScreenSettings()
    login = stated_login(settings.password_file, path.parent, SCREEN_VARIABLES)
    try:
        from hexacell.screen_server.server import serve_screen  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise UsageError("textual-serve is not installed", action="Install hexacell[serve]") from error
    return _until_stopped(serve_screen(options.serve, path, login, _announce, console.warn))


def _until_stopped(serving: Coroutine[Any, Any, None]) -> ExitCode:
    """Serve until Ctrl-C or a signal cancels it, which is its ordinary end."""
    with suppress(KeyboardInterrupt):
        asyncio.run(serving)
    return ExitCode.DONE


def _announce(what: str) -> None:
    Console().error(f"{what}; Ctrl-C ends it")
