"""The cell file that a command is given, with warnings about it on stderr."""

from __future__ import annotations

from pathlib import Path

from hexacell.cell.loader import Cell, load_cell
from hexacell.cell.passwords import password_warnings
from hexacell.cli.console import Console
from hexacell.config.pending_write import settle_config
from hexacell.services.preflight.warnings import certificate_warnings, exposure_warnings, telling_warnings


def cell_at(path: Path, console: Console) -> Cell:
    """The cell; raises ``FileError`` or ``SeveralErrors`` as ``load_cell`` does."""
    cell = load_cell(path)
    for warning in (*password_warnings(cell), *telling_warnings(cell)):
        console.warn(warning)
    if (settled := settle_config(*cell.config_paths)) is not None:
        console.warn(settled)
    return cell


def cell_with_devices_at(path: Path, console: Console) -> Cell:
    """The same for a command that is about the cell's devices."""
    cell = cell_at(path, console)
    for warning in (*exposure_warnings(cell), *certificate_warnings(cell)):
        console.warn(warning)
    return cell
