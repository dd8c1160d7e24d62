"""``hexacell cell validate|schema|show``, and the cell that any other command is given.

Warnings about a cell go to stderr.
"""

import argparse
import json
from pathlib import Path

from hexacell.cell.loader import Cell, describe, load_cell, require_plugins, schema, settings_document
from hexacell.cell.operation import require_archive
from hexacell.cell.passwords import password_warnings, with_passwords
from hexacell.cli.console import Console
from hexacell.config.pending_write import settle_config
from hexacell.errors import ExitCode, UsageError
from hexacell.services import preflight
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


def cell_at(path: Path, console: Console) -> Cell:
    """The cell; raises ``FileError`` or ``SeveralErrors`` as ``load_cell`` does."""
    cell = load_cell(path)
    for warning in (*password_warnings(cell), *preflight.telling_warnings(cell)):
        console.warn(warning)
    if (settled := settle_config(*cell.config_paths)) is not None:
        console.warn(settled)
    return cell


def cell_with_devices_at(path: Path, console: Console) -> Cell:
    """The cell for a command that is about its devices, with warnings about them too."""
    cell = cell_at(path, console)
    for of in (preflight.exposure_warnings, preflight.certificate_warnings, preflight.port_warnings):
        for warning in of(cell):
            console.warn(warning)
    return cell


def archive_url(url: str) -> str:
    """The address of an archive that cells share, if it is one; raises ``UsageError``."""
    try:
        require_archive(url)
    except UsageError as error:
        raise UsageError(error.problem, subject="--archive", action=error.action) from error
    return url
