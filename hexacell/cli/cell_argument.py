"""The cell file or the archive that a command is given; warnings about the cell go to stderr."""

from pathlib import Path

from hexacell.cell.loader import Cell, load_cell
from hexacell.cell.operation import mistake_in_url
from hexacell.cell.passwords import password_warnings
from hexacell.cli.console import Console
from hexacell.config.pending_write import settle_config
from hexacell.errors import UsageError
from hexacell.services.preflight import certificate_warnings, exposure_warnings, telling_warnings


def cell_at(path: Path, console: Console) -> Cell:
    """The cell; raises ``FileError`` or ``SeveralErrors`` as ``load_cell`` does."""
    cell = load_cell(path)
    for warning in (*password_warnings(cell), *telling_warnings(cell)):
        console.warn(warning)
    if (settled := settle_config(*cell.config_paths)) is not None:
        console.warn(settled)
    return cell


def cell_with_devices_at(path: Path, console: Console) -> Cell:
    """The cell for a command that is about its devices, with warnings about them too."""
    cell = cell_at(path, console)
    for warning in (*exposure_warnings(cell), *certificate_warnings(cell)):
        console.warn(warning)
    return cell


def archive_url(url: str) -> str:
    """The address of an archive that cells share, if it is one; raises ``UsageError``."""
    mistake = mistake_in_url(url)
    if mistake is not None:
        raise UsageError(mistake[0], subject="--archive", action=mistake[1])
    return url
