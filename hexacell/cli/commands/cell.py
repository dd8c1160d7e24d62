"""``hexacell cell validate|schema|show``: checks or prints a cell file."""

import argparse
import json

from hexacell.cell.loader import describe, require_plugins, schema, settings_document
from hexacell.cell.passwords import with_passwords
from hexacell.cli.cell_argument import cell_at, cell_with_devices_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.text.config_changes import files_named


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Validate a cell file, print its schema, or show it with defaults."""
    if options.action == "schema":
        console.document(schema())
        if not options.json:
            console.print(json.dumps(schema(), indent=2))
        return ExitCode.DONE
    read = cell_at if options.action == "show" else cell_with_devices_at
    cell = read(options.cell, console)
    if options.action == "show":
        console.document(settings_document(cell))
        if not options.json:
            console.print(describe(cell).rstrip("\n"))
        return ExitCode.DONE
    from hexacell.services.offline import require_stated_poses  # noqa: PLC0415 - only for this action

    require_plugins(cell)
    with_passwords(cell.settings, cell.path.parent)
    require_stated_poses(cell)
    console.document({"valid": True, "name": cell.settings.name})
    config = files_named(cell.config_paths)
    console.print(f"{options.cell}: valid, and so is its controller config {config}")
    return ExitCode.DONE
