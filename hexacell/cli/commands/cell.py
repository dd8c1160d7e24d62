"""``hexacell cell validate|schema|show``."""

from __future__ import annotations

import argparse
import json

from hexacell.application.device_setup import require_drivers
from hexacell.cell.loader import describe, load_cell, schema
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.robot_model import robot_of


def main(options: argparse.Namespace) -> ExitCode:
    """Check, explain or show a cell file."""
    console = Console(options.json)
    if options.action == "schema":
        console.document(schema())
        if not options.json:
            console.say(json.dumps(schema(), indent=2))
        return ExitCode.DONE
    cell = load_cell(options.cell)
    if options.action == "show":
        console.document(cell.settings.model_dump(mode="json"))
        if not options.json:
            console.say(describe(cell).rstrip("\n"))
        return ExitCode.DONE
    robot_of(cell)
    require_drivers(cell.settings)
    console.document({"valid": True, "name": cell.settings.name})
    console.say(f"{options.cell}: in order, and so is its controller config {cell.config_path}")
    return ExitCode.DONE
