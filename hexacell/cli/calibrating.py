"""Running the engine from the command line, shared by ``demo`` and ``run``."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress
from typing import Any

from hexacell.cli.console import Console
from hexacell.cli.progress import RunProgress
from hexacell.composition.calibration import Order, calibrate
from hexacell.errors import ExitCode
from procedures import events
from procedures.calibration import expected_records


def carry_out(order: Order, console: Console) -> events.Ended:
    """Run to the end with a progress bar; SIGTERM stops cleanly as Ctrl-C does.

    Raises:
        HexacellError: it could not begin, or a step could not be done.
        KeyboardInterrupt: somebody stopped it.
    """
    factor = order.cell.settings.timing.clock_factor
    if factor != 1.0:
        console.say(f"The cell's clock runs {factor:g} times as fast as the one on the wall.")
    with RunProgress(console, expected_records(order.cell.settings, order.mode)) as progress:
        try:
            return asyncio.run(_until_stopped(order, progress))
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None


async def _until_stopped(order: Order, progress: RunProgress) -> events.Ended:
    task = asyncio.current_task()
    loop = asyncio.get_running_loop()
    if task is not None:
        with suppress(NotImplementedError, ValueError, RuntimeError):
            loop.add_signal_handler(signal.SIGTERM, task.cancel)
    return await calibrate(order, [progress])


def run_document(order: Order, ended: events.Ended) -> dict[str, Any]:
    """What ``run --json`` and ``demo --json`` print."""
    return {
        "exit_code": ended.exit_code,
        "line": ended.line,
        "run": str(order.folder.path),
        "measurements": str(order.folder.measurements),
        "config": str(order.cell.config_path),
    }


def finish(order: Order, ended: events.Ended, console: Console) -> ExitCode:
    """Say how it ended and where everything is."""
    console.document(run_document(order, ended))
    console.say(f"everything about this run is in {order.folder.path}")
    console.say(ended.line)
    return ExitCode(ended.exit_code)
