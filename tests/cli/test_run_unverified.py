"""What is printed when a run ends early."""

import pytest

from hexacell.cell.loader import load_cell
from hexacell.cli.commands.run import execute_run
from hexacell.cli.console import Console
from hexacell.errors import CellBusy
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.steps import events
from procedures.steps.roll_back import RollBack
from tests.recorded_events import record

COMMITTED = events.Committed(approved_by="a tester")
WITHDRAWN = [events.StepBegun(step=RollBack()), events.RolledBack()]
UNVERIFIED = "The controller's config holds the new geometry, which is not verified yet"


@pytest.mark.parametrize(("history", "is_said"), [([COMMITTED], True), ([COMMITTED, *WITHDRAWN], False)])
def test_an_unverified_geometry_is_always_reported(cell_folder, capsys, history, is_said: bool) -> None:
    """Also if resuming fails before the engine runs."""
    folder = RunFolder(cell_folder.path / "run")
    folder.path.mkdir()
    record(folder.journal, history)
    cell = load_cell(cell_folder.cell)
    order = RunRequest(cell, folder, Mode.OPTIMISE, UnattendedOperator(), unattended=True, resume=True)
    with cell_lock(cell.config_path), pytest.raises(CellBusy):
        execute_run(order, Console())
    assert (UNVERIFIED in capsys.readouterr().err) == is_said
