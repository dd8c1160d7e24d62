"""Rollbacks of the controller's config: to any version that a run kept, and never over an edit."""

import pytest

from hexacell.cell.loader import Cell
from hexacell.config.change import AFTER, BEFORE
from hexacell.config.versions import ConfigEditedSince
from hexacell.config.write_back import commit
from hexacell.errors import CellBusy, ExitCode, FileError, UsageError
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.write_back.config_rollback import roll_back_config
from tests.hexacell.services.proposed_runs import ProposedRun, a_cell, committed_runs, propose_run

NAMES = ("2026-11-20T100000Z", "2026-11-21T100000Z", "2026-11-22T100000Z")


@pytest.fixture
def original(cell) -> bytes:
    data: bytes = cell.config_path.read_bytes()
    return data


@pytest.fixture
def runs(cell, original) -> list[ProposedRun]:
    return committed_runs(cell, *NAMES)


def config(cell: Cell) -> bytes:
    return cell.config_path.read_bytes()


def test_one_after_the_other_is_undone(cell, runs, original) -> None:
    cell.config_path.chmod(0o640)
    for run in reversed(runs):
        assert config(cell) == run.after
        done = roll_back_config(cell)
        assert config(cell) == run.before
        assert (done.undone, done.restored) == (
            run.folder.path.absolute(),
            (run.folder.path.absolute() / BEFORE,),
        )
        assert done.change.startswith("--- config-before")
    assert config(cell) == original
    assert cell.config_path.stat().st_mode & 0o777 == 0o640
    with pytest.raises(UsageError, match="nothing is to be undone"):
        roll_back_config(cell)
    assert config(cell) == original


def test_any_run_is_restored(cell, runs) -> None:
    for number, run in enumerate(runs):
        done = roll_back_config(cell, NAMES[number])
        assert config(cell) == run.after
        assert done.restored == (run.folder.path.absolute() / AFTER,)
        assert bool(done.change) == (number != 2)
        roll_back_config(cell, str(runs[2].folder.path))
        assert config(cell) == runs[2].after


@pytest.mark.parametrize("to", [None, NAMES[0]])
def test_an_edit_is_shown_and_kept(cell, runs, to) -> None:
    edited = config(cell) + b"# somebody's note\n"
    cell.config_path.write_bytes(edited)
    with pytest.raises(ConfigEditedSince, match=f"edited since {NAMES[-1]} wrote it") as refusal:
        roll_back_config(cell, to)
    assert refusal.value.exit_code is ExitCode.USAGE
    versions = refusal.value.versions
    assert versions.is_from_written
    assert "+# somebody's note" in versions.edit
    assert not any(one.is_edited for one in versions.numbers)
    assert config(cell) == edited


def test_a_config_that_no_run_knows_is_not_lost(cell, original) -> None:
    run = propose_run(cell)
    with pytest.raises(UsageError, match="nothing is to be undone"):
        roll_back_config(cell)
    with pytest.raises(UsageError, match="wrote no config"):
        roll_back_config(cell, run.folder.path.name)
    with pytest.raises(UsageError, match="there is no run"):
        roll_back_config(cell, "never")
    assert config(cell) == original


@pytest.mark.parametrize("to", [None, NAMES[2]])
def test_a_damaged_copy_is_not_restored(cell, runs, to) -> None:
    if to is not None:
        roll_back_config(cell)
    before = config(cell)
    (runs[2].folder.path / (BEFORE if to is None else AFTER)).write_bytes(b"rubbish")
    with pytest.raises(FileError, match="damaged"):
        roll_back_config(cell, to)
    assert config(cell) == before


def test_another_robots_run_is_refused_and_a_cell_in_use_left_alone(cell, runs, tmp_path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    other = a_cell(elsewhere)
    with pytest.raises(UsageError, match="is of another config"):
        roll_back_config(other, str(runs[0].folder.path))
    with cell_lock(cell.config_path), pytest.raises(CellBusy):
        roll_back_config(cell)
    assert config(cell) == runs[-1].after


def test_a_provisional_geometry_is_taken_back_by_its_run(cell, runs) -> None:
    lent = propose_run(cell, "2026-11-23T100000Z")
    commit(lent.change, lent.folder.path / "lent")
    with pytest.raises(UsageError, match="left its provisional geometry here"):
        roll_back_config(cell, NAMES[0])
    assert config(cell) == lent.after
