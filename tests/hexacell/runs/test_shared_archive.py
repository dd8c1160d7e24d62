"""Several cells share one PostgreSQL; a real one is started, see :mod:`postgresql_server`."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from hexacell.runs.archive import INDEX, Archive
from hexacell.runs.run_folder import DocumentKind, StampedDocument, runs_folder
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import RunIndex
from tests.hexacell.services.proposed_runs import a_cell, propose_run

SUMMARY = DocumentKind.SUMMARY


def test_cells_share_it_and_keep_apart(postgresql, tmp_path) -> None:
    documents = {}
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        documents[name] = {"a": StampedDocument(name, bytes(range(256)))}
        with closing(Archive(tmp_path / name, "cell", postgresql)) as archive:
            archive.store(SUMMARY, documents[name])
            archive.store(SUMMARY, documents[name])
    for name, kept in documents.items():
        with closing(Archive(tmp_path / name, "cell", postgresql)) as archive:
            assert archive.documents(SUMMARY) == kept
            assert archive.documents(DocumentKind.RESULT) == {}
    with closing(Archive(tmp_path / "one", "cell", postgresql)) as archive:
        archive.forget(["a"])
        assert archive.documents(SUMMARY) == {}
    with closing(Archive(tmp_path / "other", "cell", postgresql)) as archive:
        assert archive.documents(SUMMARY) == documents["other"]


def test_a_history_is_served_by_it(postgresql, tmp_path: Path) -> None:
    cell = a_cell(tmp_path)
    propose_run(cell, "a")
    warnings: list[str] = []
    assert [run.name for run in past_runs(cell, RunIndex(cell, postgresql, warnings.append))] == ["a"]
    with closing(Archive(runs_folder(cell), cell.settings.name, postgresql)) as archive:
        assert list(archive.documents(SUMMARY)) == ["a"]
    assert not (runs_folder(cell) / INDEX).exists()
    assert warnings == []


def test_several_machines_may_keep_the_same_at_once(postgresql, tmp_path: Path) -> None:
    def fill(number: int) -> None:
        with closing(Archive(tmp_path, "cell", postgresql)) as archive:
            for count in range(5):
                archive.store(SUMMARY, {name: StampedDocument(str(count), b"x") for name in "abcdef"})

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(fill, range(4)))
    with closing(Archive(tmp_path, "cell", postgresql)) as archive:
        assert set(archive.documents(SUMMARY)) == set("abcdef")
