"""Temporary files of processes that died in the middle of a write."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hexacell.storage import atomic_files
from tests.hexacell.storage.atomic_files.conftest import names


@pytest.fixture
def died(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    class Death(BaseException):
        pass

    def die(_: object, __: object) -> None:
        raise Death

    def write(path: Path) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", die)
            patch.setattr(Path, "unlink", lambda *_, **__: None)
            with pytest.raises(Death):
                atomic_files.write_atomically(path, b"half a thought")

    return write


def test_temporaries_of_one_file_are_removed_and_no_others(path: Path, died: Any) -> None:
    other = path.with_name("other.toml")
    died(path)
    died(path)
    died(other)
    assert len(names(path.parent)) == 4
    atomic_files.remove_stale_temporaries(path)
    assert len(names(path.parent)) == 2
    assert path.read_bytes() == b"old"
    atomic_files.remove_stale_temporaries(other)
    assert names(path.parent) == [path.name]


def test_temporaries_of_the_target_of_a_link_are_removed(path: Path, tmp_path: Path, died: Any) -> None:
    link = tmp_path / "elsewhere" / "link.toml"
    link.parent.mkdir()
    link.symlink_to(path)
    died(link)
    atomic_files.remove_stale_temporaries(link)
    assert names(path.parent) == [path.name, "elsewhere"]


def test_all_temporaries_in_a_folder_are_removed(path: Path, died: Any) -> None:
    died(path)
    died(path.with_name("other.toml"))
    atomic_files.remove_stale_temporaries(path.parent)
    assert names(path.parent) == [path.name]


def test_temporaries_in_a_read_only_folder_are_left(ordinary_folder: Path, died: Any) -> None:
    died(ordinary_folder / "file")
    ordinary_folder.chmod(0o500)
    atomic_files.remove_stale_temporaries(ordinary_folder / "file")
    assert len(names(ordinary_folder)) == 1
