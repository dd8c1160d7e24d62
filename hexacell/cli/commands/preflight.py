"""``hexacell preflight``: checks everything that must hold before motion."""

import argparse
import asyncio
from dataclasses import asdict
from typing import Any

from drivers.errors import BusError, ConnectionLost, GaugeSilent, PortLost, SilentNodeError, WrongAnswer
from hexacell.cli.commands.cell import cell_with_devices_at
from hexacell.cli.console import Console
from hexacell.dry_run.campaign import try_quick_level
from hexacell.errors import ExitCode, HexacellError, flatten_errors
from hexacell.services.offline import try_plan
from hexacell.services.run.calibration_run import new_calibration, preflight
from hexacell.text.layout import wrapped
from hexacell.text.planning import plan_trial_lines, preflight_lines, quick_trial_text
from hexacell.text.screens.checklist import exclusions_text
from procedures.calibration.calibration import Mode

MISSING = (PortLost, GaugeSilent, WrongAnswer, BusError, SilentNodeError, ConnectionLost)
SEARCH = (
    "`hexacell devices` shows what is connected to this computer, as text for a cell file, and "
    "`hexacell devices --diagnose NAME --cell CELL` watches one device of a cell"
)


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Report every failure at once, move nothing; then predict what the plan gives."""
    cell = cell_with_devices_at(options.cell, console)
    mode = Mode(options.mode)
    try:
        devices = asyncio.run(preflight(cell, mode, unattended=options.unattended))
    except HexacellError as failed:
        if any(isinstance(one, MISSING) for one in flatten_errors(failed)):
            console.error(wrapped(f"hexacell: {SEARCH}"))
        raise
    for line in preflight_lines(devices):
        console.print(wrapped(line, indent=6))
    if excluded := exclusions_text(cell.settings):
        console.print(wrapped(excluded))
    expected: dict[str, Any]
    if mode is Mode.QUICK:
        tried = try_quick_level(new_calibration(cell, mode).at_start.quick)
        expected = {"points": tried.points, "minutes": tried.minutes, "quick": tried.accuracy}
        document = {"ready": True, "devices": devices, "expected": expected}
        console.show(document, wrapped(quick_trial_text(tried)))
        return ExitCode.DONE
    trial = try_plan(cell)
    expected = {
        **asdict(trial.result),
        "minutes": trial.result.minutes,
        "averaging": trial.averaging,
        "encoders_part_mm": trial.encoders_part_mm,
        "lost": trial.unreachable,
    }
    console.document({"ready": True, "devices": devices, "expected": expected})
    for line in plan_trial_lines(trial):
        console.print(wrapped(line))
    return ExitCode.DONE
