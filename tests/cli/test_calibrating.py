"""The last words of a run that did not come to its end."""

from __future__ import annotations

import pytest

from hexacell.archive import RunFolder
from hexacell.cell.file import load_cell
from hexacell.cli.calibrating import carry_out
from hexacell.cli.console import Console
from hexacell.composition.calibration import Order
from hexacell.errors import CellBusy
from hexacell.lock import config_lock
from procedures import events
from procedures.calibration import Mode
from procedures.journal import Journal
from procedures.operators import Nobody
from procedures.steps import Compute

COMMITTED = events.Committed(approved_by="a tester")
WITHDRAWN = [events.StepBegun(step=Compute(kind="roll back")), events.RolledBack()]
UNVERIFIED = "The controller's config holds the new geometry, which is not verified yet"


@pytest.mark.parametrize(
    ("history", "is_said"), [([], False), ([COMMITTED], True), ([COMMITTED, *WITHDRAWN], False)]
)
def test_a_geometry_that_nobody_verified_is_never_left_without_a_word(
    cell_folder, capsys, history, is_said: bool
) -> None:
    """Not even where resuming fails before the engine runs."""
    folder = RunFolder(cell_folder.path / "run")
    folder.path.mkdir()
    with Journal(folder.journal) as journal:
        for event in history:
            journal.append(event)
    cell = load_cell(cell_folder.cell)
    order = Order(cell, folder, Mode.OPTIMISE, Nobody(), unattended=True, resume=True)
    with config_lock(cell.config_path), pytest.raises(CellBusy):
        carry_out(order, Console())
    assert (UNVERIFIED in capsys.readouterr().err) == is_said
