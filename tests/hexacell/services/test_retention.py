"""Old runs may be deleted; those whose result was applied never are, nor any that may still be needed."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell
from hexacell.config.write_back import commit
from hexacell.errors import CellBusy
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.history.past_runs import LEAVING, KeptFor, delete_runs, past_runs, retention
from hexacell.text.history import retention_text
from procedures.journal.journal import Entry, encode, read_journal
from tests.hexacell.services.proposed_runs import a_cell, propose_run
from tests.hexacell.services.recorded_nights import Nights

LONG_AGO = datetime(2020, 1, 1, tzinfo=UTC)


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    """Of old runs: a check, an open proposal, an applied one, one that is not over, and a damaged one."""
    cell = a_cell(tmp_path)
    Nights(cell).check()
    propose_run(cell, "proposed")
    applied = propose_run(cell, "applied")
    commit(applied.change, applied.folder.path)
    interrupted = propose_run(cell, "interrupted").folder
    interrupted.proposal.unlink()
    for name in ("proposed", "applied", "interrupted"):
        made_old(RunFolder(runs_folder(cell) / name), is_over=name != "interrupted")
    damaged = propose_run(cell, "damaged").folder
    damaged.journal.write_bytes(b"rubbish\nrubbish\n")
    return cell


def made_old(folder: RunFolder, *, is_over: bool) -> None:
    history = read_journal(folder.journal)
    kept = history if is_over else history[:-1]
    lines = [encode(Entry(number, LONG_AGO, 0.0, event)) for number, event in enumerate(kept, start=1)]
    folder.journal.write_bytes(b"".join(lines))


def names(cell: Cell) -> set[str]:
    return {run.name for run in past_runs(cell)}


def test_only_what_nobody_needs_may_go(cell) -> None:
    found = retention(cell, 30.0)
    assert [run.name for run in found.leaving] == ["2026-03-01T023000Z"]
    assert {run.name: reason for run, reason in found.kept} == {
        "proposed": KeptFor.PROPOSAL,
        "applied": KeptFor.APPLIED,
        "interrupted": KeptFor.RESUMABLE,
        "damaged": KeptFor.UNREADABLE,
    }
    assert len(names(cell)) == 5
    text = retention_text(found, is_deleted=False)
    assert text.startswith("1 of 5 runs")
    assert "applied stays: it wrote the controller's config" in text


def test_deleting_takes_the_folders_and_what_a_power_cut_left(cell) -> None:
    rest = runs_folder(cell) / f"{LEAVING}half"
    rest.mkdir()
    assert ".leaving-half" not in names(cell)
    with cell_lock(cell.config_path), pytest.raises(CellBusy):
        delete_runs(cell, retention(cell, 30.0).leaving)
    assert len(names(cell)) == 5
    assert retention(cell, 36500.0).leaving == ()
    delete_runs(cell, retention(cell, 30.0).leaving)
    assert names(cell) == {"proposed", "applied", "interrupted", "damaged"}
    assert not rest.exists()
    assert retention(cell, 30.0).leaving == ()


def test_what_was_applied_meanwhile_stays(cell) -> None:
    listed = retention(cell, 30.0).leaving
    (run,) = listed
    (run.folder.path / "applied.json").write_text("{}")
    delete_runs(cell, listed)
    assert run.name in names(cell)
    newer = propose_run(cell, "newer", shift_mm=0.5)
    commit(newer.change, newer.folder.path)
    delete_runs(cell, past_runs(cell))
    assert names(cell) >= {"applied", "newer"}, "replaced by another one, and kept"
