"""A cell that another process serves."""

import asyncio
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.run_process.client import connect_to_run
from hexacell.run_process.run_socket import socket_path
from tests.signals import terminal_signals
from tests.waiting import wait_until

NAME = "simulated-hexaglide"


async def end_run(path: Path) -> None:
    """End the run that goes on, if one does."""
    if (run := await connect_to_run(socket_path(load_cell(path)))) is not None:
        await run.leave(keep_running=False)


@contextmanager
def served_in(folder: Path) -> Iterator[Path]:
    """The cell file of a cell that is served."""
    for name in (f"{NAME}.toml", f"{NAME}.controller.toml"):
        shutil.copy(bundled_config(NAME).with_name(name), folder)
    path = folder / "served.toml"
    command = [sys.executable, "-m", "hexacell", "simulate", f"{NAME}.toml", "--output", str(path)]
    with terminal_signals():
        process = subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL)
    with process:
        try:
            wait_until(path.exists)
            yield path
        finally:
            if path.exists():
                asyncio.run(end_run(path))
            process.send_signal(signal.SIGINT)
            process.wait()
