"""The archive keeps documents, and a file that is damaged, foreign or gone is no loss."""

import os
import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from hexacell.runs import run_folder
from hexacell.runs.archive import INDEX, Archive
from hexacell.storage.atomic_files import write_atomically

SUMMARY, RESULT = run_folder.DocumentKind.SUMMARY, run_folder.DocumentKind.RESULT
ONE = {"a": run_folder.StampedDocument("1", b"one"), "b": run_folder.StampedDocument("2", b"two")}


@contextmanager
def opened(folder: Path) -> Iterator[Archive]:
    with closing(Archive(folder, "cell")) as archive:
        yield archive


def filled(folder: Path) -> Path:
    """The file of an archive with documents."""
    with opened(folder) as archive:
        archive.store(SUMMARY, ONE)
        archive.store(RESULT, {"a": run_folder.StampedDocument("1", b"result" * 5000)})
    return folder / INDEX


def test_what_is_kept_is_found_again(tmp_path) -> None:
    filled(tmp_path)
    with opened(tmp_path) as archive:
        assert archive.documents(SUMMARY) == ONE
        archive.store(SUMMARY, {"a": run_folder.StampedDocument("3", b"new")})
        assert archive.documents(SUMMARY) == ONE | {"a": run_folder.StampedDocument("3", b"new")}
        archive.forget(["a"])
        assert (list(archive.documents(SUMMARY)), archive.documents(RESULT)) == (["b"], {})


def overwrite(path: Path) -> None:
    path.write_bytes(b"rubbish" * 2000)


def cut_off(path: Path) -> None:
    os.truncate(path, 5000)


def spoil_pages(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = b"\x55" * (len(content) - 4096)
    path.write_bytes(content)


def other_columns(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        (name,) = connection.execute("select name from sqlite_master where type = 'table'").fetchone()
        connection.execute(f"drop table {name}")
        connection.execute(f"create table {name} (x int)")


@pytest.mark.parametrize("damage", [overwrite, cut_off, spoil_pages, other_columns, Path.unlink])
def test_a_damaged_file_is_replaced(tmp_path, damage) -> None:
    damage(filled(tmp_path))
    with opened(tmp_path) as archive:
        assert archive.documents(SUMMARY) == {}
        archive.store(SUMMARY, ONE)
    with opened(tmp_path) as archive:
        assert archive.documents(SUMMARY) == ONE


def test_what_cannot_be_used_says_so_and_is_left_alone(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("hexacell.runs.archive.PATIENCE_S", 0.1)
    path = filled(tmp_path)
    before = path.read_bytes()
    with closing(sqlite3.connect(path)) as other:
        other.execute("begin exclusive")
        with opened(tmp_path) as archive, pytest.raises(run_folder.ArchiveUnavailable, match="locked"):
            archive.documents(SUMMARY)
    assert path.read_bytes() == before


def test_others_may_not_write_it(tmp_path) -> None:
    old = os.umask(0)
    try:
        path = filled(tmp_path)
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o002 == 0


def test_every_change_of_a_folder_shows(tmp_path) -> None:
    run = run_folder.RunFolder(tmp_path / "a")
    run.path.mkdir()
    seen = [run_folder.folder_stamps(tmp_path)["a"]]
    run.journal.write_bytes(b"1\n")
    seen.append(run_folder.folder_stamps(tmp_path)["a"])
    with run.journal.open("ab") as journal:
        journal.write(b"2\n")
    seen.append(run_folder.folder_stamps(tmp_path)["a"])
    write_atomically(run.proposal, b"{}")
    seen.append(run_folder.folder_stamps(tmp_path)["a"])
    run.proposal.unlink()
    seen.append(run_folder.folder_stamps(tmp_path)["a"])
    assert len(set(seen)) == len(seen)
    assert run_folder.folder_stamps(tmp_path)["a"] == seen[-1]
    assert run_folder.folder_stamps(tmp_path / "none") == {}


def test_what_is_no_file_is_left_alone(tmp_path) -> None:
    (tmp_path / INDEX).mkdir()
    with opened(tmp_path) as archive, pytest.raises(run_folder.ArchiveUnavailable):
        archive.documents(SUMMARY)
    assert (tmp_path / INDEX).is_dir()


def test_several_processes_may_keep_the_same_at_once(tmp_path) -> None:
    def fill(number: int) -> dict[str, run_folder.StampedDocument]:
        with opened(tmp_path) as archive:
            for count in range(5):
                archive.store(
                    SUMMARY, {name: run_folder.StampedDocument(str(count), b"x") for name in "abcdef"}
                )
            return archive.documents(SUMMARY)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(fill, range(4)))
    assert all(set(one) == set("abcdef") for one in found)
    with opened(tmp_path) as archive:
        assert {one.stamp for one in archive.documents(SUMMARY).values()} == {"4"}
