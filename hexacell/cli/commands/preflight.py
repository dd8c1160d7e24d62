"""``hexacell preflight``: everything that must hold before motion."""

from __future__ import annotations

import argparse
import asyncio

from hexacell.cell.file import load_cell
from hexacell.cli.console import Console
from hexacell.cli.words import device_words, wrapped
from hexacell.composition.calibration import preflight
from hexacell.errors import ExitCode
from procedures.calibration import Mode


def main(options: argparse.Namespace) -> ExitCode:
    """Check, move nothing, report every failure at once."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    found = asyncio.run(preflight(cell, Mode.OPTIMISE, unattended=options.unattended))
    console.document({"ready": True, "devices": [identity.model_dump() for identity in found]})
    for identity in found:
        console.say(wrapped(f"ok  {device_words(identity)}", indent=6))
    console.say("ok  all points can be reached, all devices answer; nothing was moved")
    return ExitCode.DONE
