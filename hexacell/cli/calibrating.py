"""Running the engine from the command line, shared by ``demo`` and ``run``."""

from __future__ import annotations

import asyncio
import shlex
from typing import Any

from hexacell.cli.console import Console
from hexacell.cli.progress import RunProgress
from hexacell.composition.calibration import Order, calibrate
from hexacell.errors import ExitCode, HexacellError
from procedures import events
from procedures.calibration import Mode, expected_records


def carry_out(order: Order, console: Console) -> events.Ended:
    """Run to the end with a progress bar.

    Raises:
        HexacellError: it could not begin, or a step could not be done.
        KeyboardInterrupt: somebody stopped it.
    """
    factor = order.cell.settings.timing.clock_factor
    if factor != 1.0:
        console.say(f"The cell's clock runs {factor:g} times as fast as the one on the wall.")
    progress = RunProgress(console, expected_records(order.cell.settings, order.mode))
    try:
        with progress:
            return asyncio.run(calibrate(order, [progress]))
    except (HexacellError, KeyboardInterrupt):
        if progress.has_begun:
            console.say(f"Stopped; what was measured is kept. To go on:\n  {resume_command(order)}")
        raise


def resume_command(order: Order) -> str:
    """What to type to go on with a run, by somebody at a terminal."""
    mode = ["--mode", "check"] if order.mode is Mode.CHECK else []
    words = ["hexacell", "run", str(order.cell.path), "--resume", str(order.folder.path), *mode]
    return shlex.join(words)


def run_document(order: Order, ended: events.Ended) -> dict[str, Any]:
    """What ``run --json`` and ``demo --json`` print."""
    measurements = order.folder.measurements
    return {
        "exit_code": ended.exit_code,
        "line": ended.line,
        "run": str(order.folder.path),
        "measurements": str(measurements) if measurements.is_file() else None,
        "config": str(order.cell.config_path),
    }


def finish(order: Order, ended: events.Ended, console: Console) -> ExitCode:
    """Say how it ended and where everything is."""
    console.document(run_document(order, ended))
    console.say(f"Everything about this run is in {order.folder.path}")
    console.say(ended.line)
    return ExitCode(ended.exit_code)
