"""An archive that cells share: its address on the command line, and how a cell is put there."""

from __future__ import annotations

from hexacell.cell.operation import mistake_in_url
from hexacell.cli.console import Console
from hexacell.errors import FileError, UsageError
from hexacell.services.history.cell_status import CellStatus, publish_status


def archive_url(url: str) -> str:
    """The address, if it is one; raises ``UsageError``."""
    mistake = mistake_in_url(url)
    if mistake is not None:
        raise UsageError(mistake[0], subject="--archive", action=mistake[1])
    return url


def publish_or_warn(status: CellStatus, console: Console) -> None:
    """Put how a cell is into the archive that it shares; what prevents it is said in one line."""
    try:
        publish_status(status)
    except FileError as error:
        console.warn(" ".join(str(error).split()))
