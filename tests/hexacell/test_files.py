import errno
import os
import resource
import shutil
import stat
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell import files
from hexacell.errors import ExitCode, FileError

NOBODY = 65534


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "controller.toml"
    path.write_bytes(b"old")
    return path


@pytest.fixture
def ordinary_folder() -> Iterator[Path]:
    """A folder of an ordinary user's, whose rights this process then has, even if run by root."""
    folder = Path(tempfile.mkdtemp())
    is_root = os.geteuid() == 0
    if is_root:
        os.chown(folder, NOBODY, NOBODY)
        os.setegid(NOBODY)
        os.seteuid(NOBODY)
    try:
        yield folder
    finally:
        if is_root:
            os.seteuid(0)
            os.setegid(0)
        folder.chmod(0o700)
        shutil.rmtree(folder)


@given(st.binary(max_size=300), st.binary(max_size=300))
def test_what_is_written_is_read(old: bytes, new: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        for data in (old, new):
            files.write_atomically(path, data)
            assert files.read_bytes(path) == data
        assert names(Path(folder)) == ["file"]


def test_readers_see_the_old_text_or_the_new_one_never_a_mixture(path: Path) -> None:
    texts = [character * 200_000 for character in (b"a", b"b")]
    files.write_atomically(path, texts[0])
    seen, done = set(), threading.Event()

    def read() -> None:
        while not done.is_set():
            seen.add(path.read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    for turn in range(20):
        files.write_atomically(path, texts[turn % 2])
    done.set()
    reader.join()
    assert seen <= set(texts)


def test_the_mode_stays(path: Path) -> None:
    for mode in (0o600, 0o640, 0o664, 0o755):
        path.chmod(mode)
        files.write_atomically(path, b"new")
        assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_new_file_has_the_mode_the_user_gives_new_files(tmp_path: Path) -> None:
    usual, ours = tmp_path / "usual", tmp_path / "ours"
    usual.write_bytes(b"")
    files.write_atomically(ours, b"new")
    assert ours.stat().st_mode == usual.stat().st_mode


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_the_owner_stays(path: Path) -> None:
    os.chown(path, NOBODY, NOBODY)
    files.write_atomically(path, b"new")
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
        files.write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(ordinary_folder) == ["controller.toml"]


@pytest.mark.skipif(not hasattr(os, "setxattr"), reason="no extended attributes on this system")
def test_extended_attributes_stay(path: Path) -> None:
    try:
        os.setxattr(path, "user.remark", b"mine")
    except OSError:
        pytest.skip("no extended attributes on this file system")
    files.write_atomically(path, b"new")
    assert os.getxattr(path, "user.remark") == b"mine"


def test_a_file_system_without_extended_attributes_is_no_failure(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unsupported(_: Path) -> list[str]:
        raise OSError(errno.ENOTSUP, "not supported")

    monkeypatch.setattr(os, "listxattr", unsupported, raising=False)
    files.write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_links_are_followed_and_stay(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "second").symlink_to(path)
    (folder / "first").symlink_to("second")
    files.write_atomically(folder / "first", b"new")
    assert (folder / "first").is_symlink()
    assert (folder / "second").is_symlink()
    assert path.read_bytes() == b"new"
    assert names(folder) == ["first", "second"]


def test_a_link_to_nowhere_makes_the_file(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("absent")
    files.write_atomically(tmp_path / "link", b"new")
    assert (tmp_path / "absent").read_bytes() == b"new"


def test_a_circle_of_links_is_told(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    for call in (lambda path: files.write_atomically(path, b"new"), files.read_bytes):
        with pytest.raises(FileError, match="go round in a circle"):
            call(tmp_path / "a")


def test_names_of_the_greatest_length_can_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 255)
    files.write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_a_file_that_is_not_as_expected_is_left_alone(path: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="changed by somebody else"):
        files.write_atomically(path, b"new", expected=b"older")
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == [path.name]
    files.write_atomically(path, b"new", expected=b"old")
    assert path.read_bytes() == b"new"


def test_a_read_only_folder_is_told(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    ordinary_folder.chmod(0o500)
    with pytest.raises(FileError, match="is as it was: permission denied") as caught:
        files.write_atomically(path, b"new")
    assert caught.value.subject == str(path)
    assert caught.value.exit_code is ExitCode.USAGE
    assert path.read_bytes() == b"old"


def test_a_write_protected_file_is_left_alone(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    path.chmod(0o444)
    with pytest.raises(FileError, match="permission denied"):
        files.write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(ordinary_folder) == [path.name]


def test_an_unreadable_file_is_told(ordinary_folder: Path) -> None:
    path = ordinary_folder / "controller.toml"
    path.write_bytes(b"old")
    path.chmod(0o000)
    with pytest.raises(FileError, match="cannot be read: permission denied"):
        files.read_bytes(path)


def test_a_write_that_the_kernel_cuts_short_leaves_nothing(path: Path, tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(FileError, match="cannot be written and is as it was"):
            files.write_atomically(path, b"x" * 100_000)
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
@pytest.mark.parametrize("name", ["replace", "fchmod"])
def test_failures_are_told_in_plain_words(
    path: Path, monkeypatch: pytest.MonkeyPatch, name: str, code: int, words: str
) -> None:
    def fail(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, name, fail)
    with pytest.raises(FileError, match="is as it was") as caught:
        files.write_atomically(path, b"new")
    assert words in str(caught.value)
    assert path.read_bytes() == b"old"
    assert names(path.parent) == [path.name]


def test_a_folder_that_does_not_reach_the_disk_is_told(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(folder: Path) -> None:
        assert folder == path.parent
        raise OSError(errno.EIO, "x")

    monkeypatch.setattr(files, "sync_folder", fail)
    with pytest.raises(FileError, match="was replaced, but perhaps not for good"):
        files.write_atomically(path, b"new")
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
    files.write_atomically(path, b"12345")
    assert order == ["data 5", "name", "folder"]


@pytest.mark.parametrize(("code", "fails"), [(errno.EINVAL, False), (errno.EIO, True)])
def test_file_systems_that_cannot_sync_folders_are_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, fails: bool
) -> None:
    def fsync(_: int) -> None:
        raise OSError(code, "x")

    monkeypatch.setattr(os, "fsync", fsync)
    if fails:
        with pytest.raises(OSError, match="x"):
            files.sync_folder(tmp_path)
    else:
        files.sync_folder(tmp_path)


def test_an_interrupt_leaves_no_temporary_file(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        files.write_atomically(path, b"new")
    assert names(tmp_path) == [path.name]


def test_pipes_folders_and_absent_files_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, words in (("pipe", "not a file"), (".", "not a file"), ("absent", "does not exist")):
        with pytest.raises(FileError, match=words):
            files.read_bytes(tmp_path / name)
    for name in ("pipe", "."):
        with pytest.raises(FileError, match="not a file"):
            files.write_atomically(tmp_path / name, b"new")
    with pytest.raises(FileError, match="does not exist"):
        files.write_atomically(tmp_path / "no" / "folder", b"new")


def test_read_if_present(path: Path, tmp_path: Path) -> None:
    assert files.read_if_present(path) == b"old"
    assert files.read_if_present(tmp_path / "absent") is None
    with pytest.raises(FileError, match="not a file"):
        files.read_if_present(tmp_path)
    with pytest.raises(FileError, match="a part of the path is not a folder"):
        files.read_if_present(path / "below")


def test_text_keeps_its_line_ends_and_tells_the_line_that_is_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\n")
    assert files.read_text(path) == "\ufeffa\r\nb\n"
    path.write_bytes("a\nb\nmäßig\n".encode("latin-1"))
    with pytest.raises(FileError, match="not UTF-8") as caught:
        files.read_text(path)
    assert caught.value.line == 3


def test_folders_are_made_with_those_above(tmp_path: Path) -> None:
    files.make_folder(tmp_path / "a" / "b")
    files.make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_bytes(b"")
    for name in ("file", "file/below"):
        with pytest.raises(FileError, match="the folder cannot be made"):
            files.make_folder(tmp_path / name)


def test_every_folder_that_is_made_is_a_name_for_good_in_the_one_above(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    monkeypatch.setattr(files, "sync_folder", synced.append)
    files.make_folder(tmp_path / "runs" / "cell" / "run")
    assert set(synced) == {tmp_path, tmp_path / "runs", tmp_path / "runs" / "cell"}


class TestLeftovers:
    """Temporary files of processes that died in the middle of a write."""

    @pytest.fixture
    def died(self, monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
        class Death(BaseException):
            pass

        def die(_: object, __: object) -> None:
            raise Death

        def write(path: Path) -> None:
            with monkeypatch.context() as patch:
                patch.setattr(os, "replace", die)
                patch.setattr(Path, "unlink", lambda *_, **__: None)
                with pytest.raises(Death):
                    files.write_atomically(path, b"half a thought")

        return write

    def test_those_of_a_file_are_removed_and_no_others(self, path: Path, died: Any) -> None:
        other = path.with_name("other.toml")
        died(path)
        died(path)
        died(other)
        assert len(names(path.parent)) == 4
        files.remove_leftovers(path)
        assert len(names(path.parent)) == 2
        assert path.read_bytes() == b"old"
        files.remove_leftovers(other)
        assert names(path.parent) == [path.name]

    def test_a_link_leads_to_those_of_its_file(self, path: Path, tmp_path: Path, died: Any) -> None:
        link = tmp_path / "elsewhere" / "link.toml"
        link.parent.mkdir()
        link.symlink_to(path)
        died(link)
        files.remove_leftovers(link)
        assert names(path.parent) == [path.name, "elsewhere"]

    def test_all_in_a_folder_are_removed(self, path: Path, died: Any) -> None:
        died(path)
        died(path.with_name("other.toml"))
        files.remove_leftovers(path.parent)
        assert names(path.parent) == [path.name]

    def test_those_that_may_not_be_removed_are_left(self, ordinary_folder: Path, died: Any) -> None:
        died(ordinary_folder / "file")
        ordinary_folder.chmod(0o500)
        files.remove_leftovers(ordinary_folder / "file")
        assert len(names(ordinary_folder)) == 1


def test_checksums_are_those_of_the_standard() -> None:
    """FIPS 180-4, the example "abc"."""
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert files.sha256(b"abc") == expected


def test_nobody_else_can_read_a_private_file_while_it_is_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, fchmod = [], os.fchmod

    def look(descriptor: int, mode: int) -> None:
        seen.append(stat.S_IMODE(os.fstat(descriptor).st_mode))
        fchmod(descriptor, mode)

    path.chmod(0o600)
    monkeypatch.setattr(os, "fchmod", look)
    files.write_atomically(path, b"new")
    assert seen == [0o600]
