"""A file is replaced in one go, and stays what it was: its mode, its owner, its links."""

import errno
import os
import shutil
import stat
import threading
from pathlib import Path

import pytest

from hexacell.errors import FileError
from hexacell.storage import atomic_files
from tests.hexacell.storage.atomic_files.conftest import NOBODY, names


def test_readers_see_the_old_text_or_the_new_one_never_a_mixture(path: Path) -> None:
    texts = [character * 200_000 for character in (b"a", b"b")]
    atomic_files.write_atomically(path, texts[0])
    seen, done = set(), threading.Event()

    def read() -> None:
        while not done.is_set():
            seen.add(path.read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    for turn in range(20):
        atomic_files.write_atomically(path, texts[turn % 2])
    done.set()
    reader.join()
    assert seen <= set(texts)


def test_the_mode_stays(path: Path) -> None:
    for mode in (0o600, 0o640, 0o664, 0o755):
        path.chmod(mode)
        atomic_files.write_atomically(path, b"new")
        assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_new_file_has_the_mode_the_user_gives_new_files(tmp_path: Path) -> None:
    usual, ours = tmp_path / "usual", tmp_path / "ours"
    usual.write_bytes(b"")
    atomic_files.write_atomically(ours, b"new")
    assert ours.stat().st_mode == usual.stat().st_mode


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_the_owner_stays(path: Path) -> None:
    os.chown(path, NOBODY, NOBODY)
    atomic_files.write_atomically(path, b"new")
    assert (path.stat().st_uid, path.stat().st_gid) == (NOBODY, NOBODY)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_a_file_whose_owner_cannot_be_kept_is_left_alone(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    path.chmod(0o666)
    os.seteuid(0)
    os.chown(path, 0, 0)
    os.seteuid(NOBODY)
    with pytest.raises(FileError, match=r"belongs to user 0.*Run as its owner"):
        atomic_files.write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(ordinary_folder) == ["controller.toml"]


@pytest.mark.skipif(not hasattr(os, "setxattr"), reason="no extended attributes on this system")
def test_extended_attributes_stay(path: Path) -> None:
    try:
        os.setxattr(path, "user.remark", b"mine")
    except OSError:
        pytest.skip("no extended attributes on this file system")
    atomic_files.write_atomically(path, b"new")
    assert os.getxattr(path, "user.remark") == b"mine"


def test_a_file_system_without_extended_attributes_is_no_failure(path, monkeypatch) -> None:
    def unsupported(_: Path, **_named: bool) -> list[str]:
        raise OSError(errno.ENOTSUP, "not supported")

    monkeypatch.setattr(os, "listxattr", unsupported, raising=False)
    atomic_files.write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_links_are_kept_and_their_target_is_replaced(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "second").symlink_to(path)
    (folder / "first").symlink_to("second")
    atomic_files.write_atomically(folder / "first", b"new")
    assert (folder / "first").is_symlink()
    assert (folder / "second").is_symlink()
    assert path.read_bytes() == b"new"
    assert names(folder) == ["first", "second"]


def test_a_dangling_link_creates_its_target_and_a_loop_is_reported(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("absent")
    atomic_files.write_atomically(tmp_path / "link", b"new")
    assert (tmp_path / "absent").read_bytes() == b"new"
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    for call in (lambda path: atomic_files.write_atomically(path, b"new"), atomic_files.read_bytes):
        with pytest.raises(FileError, match="form a loop"):
            call(tmp_path / "a")


def test_names_of_the_greatest_length_can_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 255)
    atomic_files.write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_a_file_that_is_not_as_expected_is_left_alone(path: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="changed by somebody else"):
        atomic_files.write_atomically(path, b"new", expected=b"older")
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == [path.name]
    atomic_files.write_atomically(path, b"new", expected=b"old")
    assert path.read_bytes() == b"new"


def test_the_order_is_data_then_name_then_folder(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order, fsync, replace = [], os.fsync, os.replace

    def record_fsync(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        order.append("folder" if is_folder else f"data {os.fstat(descriptor).st_size}")
        fsync(descriptor)

    def record_replace(*names: Path) -> None:
        order.append("name")
        replace(*names)

    monkeypatch.setattr(os, "fsync", record_fsync)
    monkeypatch.setattr(os, "replace", record_replace)
    atomic_files.write_atomically(path, b"12345")
    assert order == ["data 5", "name", "folder"]


def test_no_other_user_can_read_a_private_file_while_it_is_written(path, monkeypatch) -> None:
    seen, copystat = [], shutil.copystat

    def look(source: Path, target: Path) -> None:
        seen.append(stat.S_IMODE(target.stat().st_mode))
        copystat(source, target)

    path.chmod(0o600)
    monkeypatch.setattr(shutil, "copystat", look)
    atomic_files.write_atomically(path, b"new")
    assert seen == [0o600]
