"""Failures to write and read, and what processes left that died meanwhile."""

import errno
import os
import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from hexacell.errors import ExitCode, FileError
from hexacell.storage import atomic_files
from tests.hexacell.storage.atomic_files.conftest import names


def test_a_read_only_folder_is_reported(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    ordinary_folder.chmod(0o500)
    with pytest.raises(FileError, match="is unchanged: permission denied") as caught:
        atomic_files.write_atomically(path, b"new")
    assert caught.value.subject == str(path)
    assert caught.value.exit_code is ExitCode.USAGE
    assert path.read_bytes() == b"old"


def test_a_write_protected_file_is_left_alone(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    path.chmod(0o444)
    with pytest.raises(FileError, match="permission denied"):
        atomic_files.write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(ordinary_folder) == [path.name]


def test_an_unreadable_file_is_reported(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    path.chmod(0o000)
    with pytest.raises(FileError, match="cannot be read: permission denied"):
        atomic_files.read_bytes(path)


def test_a_write_that_the_kernel_cuts_short_leaves_nothing(path: Path, tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(FileError, match="cannot be written and is unchanged"):
            atomic_files.write_atomically(path, b"x" * 100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == [path.name]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (errno.ENOSPC, "the disk is full. Free some space"),
        (errno.EDQUOT, "quota"),
        (errno.EROFS, "read-only"),
        (errno.EIO, "the disk reports an error"),
        (errno.EBUSY, "mount point"),
        (errno.EXDEV, os.strerror(errno.EXDEV)),
    ],
)
@pytest.mark.parametrize("name", ["replace", "chmod"])
def test_failures_are_reported_in_plain_words(path, monkeypatch, name, code, words) -> None:
    monkeypatch.setattr(os, name, Mock(side_effect=OSError(code, os.strerror(code))))
    with pytest.raises(FileError, match="is unchanged") as caught:
        atomic_files.write_atomically(path, b"new")
    assert words in str(caught.value)
    assert path.read_bytes() == b"old"
    assert names(path.parent) == [path.name]


def test_a_file_mounted_alone_is_refused_before_a_run_measures(path, monkeypatch) -> None:
    atomic_files.require_replaceable(path)
    status_of, target = Path.stat, path.resolve()

    def mounted(one: Path) -> os.stat_result:
        status = status_of(one)
        return os.stat_result((*status[:2], status.st_dev + (one == target), *status[3:10]))

    monkeypatch.setattr(Path, "stat", mounted)
    with pytest.raises(FileError, match="mount point"):
        atomic_files.require_replaceable(path)


def test_a_folder_that_cannot_be_synced_is_reported(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(folder: Path) -> None:
        assert folder == path.parent
        raise OSError(errno.EIO, "x")

    monkeypatch.setattr(atomic_files, "sync_folder", fail)
    with pytest.raises(FileError, match="was replaced, but a power cut may undo that"):
        atomic_files.write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize(("code", "fails"), [(errno.EINVAL, False), (errno.EIO, True)])
def test_file_systems_that_cannot_sync_folders_are_accepted(tmp_path, monkeypatch, code, fails) -> None:
    monkeypatch.setattr(os, "fsync", Mock(side_effect=OSError(code, "x")))
    if fails:
        with pytest.raises(OSError, match="x"):
            atomic_files.sync_folder(tmp_path)
    else:
        atomic_files.sync_folder(tmp_path)


def test_an_interrupt_leaves_no_temporary_file(path, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(os, "replace", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        atomic_files.write_atomically(path, b"new")
    assert names(tmp_path) == [path.name]


def test_pipes_folders_and_absent_files_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, words in (("pipe", "not a file"), (".", "not a file"), ("absent", "does not exist")):
        with pytest.raises(FileError, match=words):
            atomic_files.read_bytes(tmp_path / name)
    for name in ("pipe", "."):
        with pytest.raises(FileError, match="not a file"):
            atomic_files.write_atomically(tmp_path / name, b"new")
    with pytest.raises(FileError, match="does not exist"):
        atomic_files.write_atomically(tmp_path / "no" / "folder", b"new")


@pytest.fixture
def died(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    class Death(BaseException):
        pass

    def write(path: Path) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", Mock(side_effect=Death))
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


def test_files_are_read_if_present_and_text_keeps_its_line_ends(path: Path, tmp_path: Path) -> None:
    assert atomic_files.read_if_present(path) == b"old"
    assert atomic_files.read_if_present(tmp_path / "absent") is None
    with pytest.raises(FileError, match="not a file"):
        atomic_files.read_if_present(tmp_path)
    with pytest.raises(FileError, match="a part of the path is not a folder"):
        atomic_files.read_if_present(path / "below")
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\n")
    assert atomic_files.read_text(path) == "a\r\nb\n"
    path.write_bytes("a\nb\nmäßig\n".encode("latin-1"))
    with pytest.raises(FileError, match="not UTF-8") as caught:
        atomic_files.read_text(path)
    assert caught.value.line == 3


def test_folders_are_made_with_those_above(tmp_path: Path) -> None:
    atomic_files.create_folder_durably(tmp_path / "a" / "b")
    atomic_files.create_folder_durably(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_bytes(b"")
    for name in ("file", "file/below"):
        with pytest.raises(FileError, match="the folder cannot be made"):
            atomic_files.create_folder_durably(tmp_path / name)


def test_the_name_of_every_new_folder_is_synced_in_its_parent(tmp_path, monkeypatch) -> None:
    synced: list[Path] = []
    monkeypatch.setattr(atomic_files, "sync_folder", synced.append)
    atomic_files.create_folder_durably(tmp_path / "runs" / "cell" / "run")
    assert set(synced) == {tmp_path, tmp_path / "runs", tmp_path / "runs" / "cell"}
