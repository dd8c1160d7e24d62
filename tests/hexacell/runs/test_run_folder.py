"""Run folders: one a run, none written twice, and found again by name."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import ExitCode, UsageError
from hexacell.runs import run_folder
from hexacell.runs.run_folder import RunFolder, find_run, new_run, runs_folder, unused


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    path = tmp_path / "cell.toml"
    path.write_text(bundled_config("simulated-hexaglide").read_text())
    return load_cell(path)


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder(tmp_path / "run")


class Noon(datetime):
    """A clock that is fixed at noon."""

    @classmethod
    def now(cls, tz=None):
        return datetime(2026, 11, 20, 12, 0, 0, tzinfo=UTC).astimezone(tz)


def test_runs_of_the_same_second_get_folders_of_their_own(cell: Cell, monkeypatch) -> None:
    monkeypatch.setattr(run_folder, "datetime", Noon)
    names = []
    for _ in range(3):
        run = new_run(cell)
        assert not run.path.exists(), "a name makes nothing"
        run.create(cell)
        names.append(run.path.name)
    assert names == ["2026-11-20T120000Z", "2026-11-20T120000Z-2", "2026-11-20T120000Z-3"]
    assert sorted(names) == names


def test_a_folder_that_holds_a_run_takes_no_other(cell: Cell, folder: RunFolder) -> None:
    folder.create(cell)
    assert (folder.path / "cell.toml").read_bytes() == cell.text.encode()
    folder.journal.write_text("something happened\n")
    (folder.path / "cell.toml").write_text("as it was")
    with pytest.raises(UsageError, match=r"holds a run already.*Resume") as refusal:
        folder.create(cell)
    assert refusal.value.exit_code is ExitCode.USAGE
    assert folder.journal.read_text() == "something happened\n"
    assert (folder.path / "cell.toml").read_text() == "as it was"


def test_every_part_of_a_run_has_a_wire_trace_of_its_own(cell: Cell, folder: RunFolder) -> None:
    folder.create(cell)
    for name in ("wire", "wire-2", "wire-3"):
        path = unused(folder.wire)
        assert path == folder.path / name
        path.touch()


def test_a_run_is_found_by_its_folder_or_name_and_is_none_without_a_journal(cell: Cell) -> None:
    run = new_run(cell)
    run.create(cell)
    run.journal.touch()
    assert find_run(cell, run.path.name) == run
    assert find_run(cell, str(run.path)) == run
    run = new_run(cell)
    run.create(cell)
    for named in (run.path.name, str(run.path), "", " ", "nonsense"):
        with pytest.raises(UsageError, match="there is no run") as refusal:
            find_run(cell, named)
        assert str(runs_folder(cell)) in str(refusal.value)
