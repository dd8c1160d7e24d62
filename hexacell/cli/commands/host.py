"""``hexacell host``: the process of a run that screens connect to and leave; started by the program."""

import argparse
import asyncio
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from socket import socket

from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.cli.terminal import SignalCommands
from hexacell.errors import ExitCode, HexacellError
from hexacell.plugins import plugin_failures_named
from hexacell.run_process.client import READY
from hexacell.run_process.host import RemoteOperator, RunHost, failure_message
from hexacell.run_process.messages import message_line
from hexacell.run_process.run_socket import listening_socket, socket_path
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from procedures.calibration.calibration import Mode


def main(options: argparse.Namespace, _: Console) -> ExitCode:
    """Serve one run; stdout gets one line, which says that it listens or why it does not."""
    if os.fork():
        os._exit(0)  # whoever started it need not wait for its end
    try:
        with plugin_failures_named():
            _serve(options)
    except HexacellError as error:
        _say(message_line(failure_message(error)))
        return error.exit_code
    return ExitCode.DONE


def _serve(options: argparse.Namespace) -> None:
    request = RunRequest(
        cell=load_cell(options.cell),
        folder=RunFolder(options.folder),
        mode=Mode(options.mode),
        operator=RemoteOperator(),
        resume=options.resume,
        length_check=options.length_check,
    )
    signals = SignalCommands(Console(wants_json=True))
    path = socket_path(request.cell)
    with listening_socket(path) as listener, _own_temporary_folder() as folder:
        host = RunHost(request, signals.queue)
        _say(READY)
        signals.run(_serve_and_exit(host, listener, (path, folder)))


async def _serve_and_exit(host: RunHost, listener: socket, traces: tuple[Path, Path]) -> None:
    """Exit at once when the run is over: a computation that nobody waits for may go on in a thread."""
    code = await host.serve(listener)
    path, folder = traces
    await asyncio.to_thread(path.unlink, missing_ok=True)
    await asyncio.to_thread(shutil.rmtree, folder, ignore_errors=True)
    os._exit(int(code))


@contextmanager
def _own_temporary_folder() -> Iterator[Path]:
    """Where temporary files of the run are, a simulated cell's too: whoever exits at once removes them."""
    with tempfile.TemporaryDirectory(prefix="hexacell-run-") as folder:
        tempfile.tempdir = folder
        try:
            yield Path(folder)
        finally:
            tempfile.tempdir = None


def _say(line: bytes) -> None:
    """The one line for who started it, who need not read more."""
    stdout = sys.stdout.fileno()
    os.write(stdout, line)
    with Path(os.devnull).open("wb") as null:
        os.dup2(null.fileno(), stdout)
