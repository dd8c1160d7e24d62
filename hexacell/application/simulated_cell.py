"""A simulated cell served to other processes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hexacell.application.device_setup import device_addresses
from hexacell.cell.loader import Cell, dump
from hexacell.errors import UsageError


def require_simulation(cell: Cell) -> Cell:
    """The same cell, once it is certain that it needs no devices.

    Raises:
        UsageError: it is a real cell.
    """
    if cell.settings.simulation is None:
        raise UsageError("there is no [simulation] in it: this is a real cell", subject=cell.path)
    return cell


@contextmanager
def served_cell(cell: Cell) -> Iterator[str]:
    """Serve a simulated cell within this context; gives a cell file that reaches it, as text.

    Raises:
        UsageError: it is a real cell.
        HexacellError: the simulation cannot start.
    """
    require_simulation(cell)
    with device_addresses(cell, other_processes=True) as settings:
        controller = settings.controller.model_copy(update={"config": str(cell.config_path.resolve())})
        yield dump(settings.model_copy(update={"controller": controller}))
