"""The index over the runs is as new as their folders, whatever became of it."""

import shutil
from contextlib import closing
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell
from hexacell.config.write_back import commit
from hexacell.runs.archive import INDEX, Archive
from hexacell.runs.run_folder import DocumentKind, StampedDocument, runs_folder
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import PastRun
from procedures.journal.journal import Entry, read_entries
from procedures.steps import events
from tests.hexacell.services.proposed_runs import a_cell, propose_run
from tests.recorded_events import record

SUMMARY = DocumentKind.SUMMARY


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    cell = a_cell(tmp_path)
    for name in ("a", "b"):
        propose_run(cell, name)
    return cell


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The runs whose journals were read."""
    names: list[str] = []

    def noted(path: Path) -> tuple[Entry, ...]:
        names.append(path.parent.name)
        return read_entries(path)

    monkeypatch.setattr("hexacell.services.history.run_summary.read_entries", noted)
    return names


def names(runs: tuple[PastRun, ...]) -> list[str]:
    return [run.name for run in runs]


def test_folders_are_read_once_and_again_when_they_change(cell, opened) -> None:
    first = past_runs(cell)
    assert (names(first), sorted(opened)) == (["b", "a"], ["a", "b"])
    opened.clear()
    assert past_runs(cell) == first
    assert opened == []
    record(runs_folder(cell) / "a" / "journal.jsonl", [events.Interrupted(reason="later", exit_code=3)])
    past_runs(cell)
    assert opened == ["a"]


def test_what_is_written_later_shows(cell) -> None:
    assert not any(run.is_in_controller or run.summary.has_written for run in past_runs(cell))
    third = propose_run(cell, "c")
    past_runs(cell)
    commit(third.change, third.folder.path)
    assert [run.is_in_controller for run in past_runs(cell)] == [True, False, False]


def test_a_run_that_is_gone_is_forgotten(cell) -> None:
    past_runs(cell)
    shutil.rmtree(runs_folder(cell) / "a")
    assert names(past_runs(cell)) == ["b"]
    with closing(Archive(runs_folder(cell), cell.settings.name)) as archive:
        assert list(archive.documents(SUMMARY)) == ["b"]


def test_a_damaged_index_is_made_anew(cell, opened) -> None:
    first = past_runs(cell)
    with closing(Archive(runs_folder(cell), cell.settings.name)) as archive:
        stamp = archive.documents(SUMMARY)["a"].stamp
        archive.store(SUMMARY, {"a": StampedDocument(stamp, b'{"mode": 3}')})
    assert past_runs(cell) == first, "a damaged document is read from its folder"
    path = runs_folder(cell) / INDEX
    path.write_bytes(b"rubbish" * 1000)
    assert past_runs(cell) == first
    opened.clear()
    assert past_runs(cell) == first
    assert opened == []
