import fcntl
import getpass
import os
import re
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hexacell.errors import CellBusy, ExitCode, FileError
from hexacell.storage.cell_lock import cell_lock, config_lock, lock_path

HOLD = """
import sys
from pathlib import Path
from hexacell.storage.cell_lock import cell_lock
with cell_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "controller.toml").write_text("")
    path = tmp_path / "cell.toml"
    path.write_text('[controller]\nconfig = "controller.toml"\n')
    return path


@contextmanager
def another_process(cell: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that holds the cell until its standard input closes."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(cell)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process


def is_busy(cell: Path) -> bool:
    try:
        with cell_lock(cell):
            return False
    except CellBusy:
        return True


def test_another_process_is_kept_out_and_told_who_holds_the_cell(cell: Path) -> None:
    with another_process(cell) as process, pytest.raises(CellBusy) as caught, cell_lock(cell):
        pytest.fail("two processes hold the cell")
    words = str(caught.value)
    assert f"process {process.pid} of {getpass.getuser()} on {socket.gethostname()} since 20" in words
    assert re.search(r"since \d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d\d:\d\d", words)
    assert caught.value.exit_code is ExitCode.BUSY
    assert process.returncode == 0
    assert not is_busy(cell)


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_process_leaves_no_stale_lock(cell: Path, death: signal.Signals) -> None:
    with another_process(cell) as process:
        assert is_busy(cell)
        process.send_signal(death)
        process.wait(timeout=10)
        assert not is_busy(cell)


def test_a_program_that_the_holder_started_does_not_keep_the_cell(cell: Path) -> None:
    """A reload command, say, that is still there when its parent has been killed."""
    with cell_lock(cell):
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        assert not is_busy(cell)
    finally:
        child.communicate(b"\n", timeout=10)


def test_a_second_descriptor_does_not_keep_the_cell(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a forked child has one."""
    flock, copies = fcntl.flock, []

    def remember(descriptor: int, operation: int) -> None:
        flock(descriptor, operation)
        copies.append(os.dup(descriptor))

    with monkeypatch.context() as patch:
        patch.setattr(fcntl, "flock", remember)
        with cell_lock(cell):
            pass
    assert copies
    assert not is_busy(cell)
    for copy in copies:
        os.close(copy)


def test_one_process_cannot_hold_it_twice(cell: Path) -> None:
    with cell_lock(cell):
        assert is_busy(cell)
    assert not is_busy(cell)


def test_an_exception_lets_go(cell: Path) -> None:
    with pytest.raises(ZeroDivisionError), cell_lock(cell):
        raise ZeroDivisionError
    assert not is_busy(cell)


def test_a_copy_of_the_cell_file_is_the_same_cell(cell: Path) -> None:
    copy = cell.with_name("copy.toml")
    copy.write_text(cell.read_text() + "# tried something\n")
    with cell_lock(cell):
        assert is_busy(copy)


def test_links_and_other_ways_to_write_the_path_are_the_same_cell(cell: Path, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "linked.toml").symlink_to("../controller.toml")
    (folder / "cell.toml").write_text('[controller]\nconfig = "linked.toml"\n')
    (folder / "absolute.toml").write_text(
        f'[controller]\nconfig = "{tmp_path}/elsewhere/../controller.toml"\n'
    )
    with cell_lock(cell):
        assert is_busy(folder / "cell.toml")
        assert is_busy(folder / "absolute.toml")


def test_another_config_is_another_cell(cell: Path) -> None:
    other = cell.with_name("other.toml")
    other.write_text('[controller]\nconfig = "other-controller.toml"\n')
    with cell_lock(cell):
        assert not is_busy(other)


def test_a_write_back_does_not_open_the_lock(cell: Path) -> None:
    config = cell.with_name("controller.toml")
    with cell_lock(cell):
        config.with_name("new").write_text("new")
        config.with_name("new").replace(config)
        assert is_busy(cell)


def test_the_lock_file_stays_and_says_nothing_when_nobody_holds_it(cell: Path) -> None:
    path = lock_path(cell.with_name("controller.toml"))
    with cell_lock(cell):
        assert str(os.getpid()) in path.read_text()
        inode = path.stat().st_ino
    assert path.read_text() == ""
    assert path.stat().st_ino == inode


def test_other_users_can_open_the_lock_file_whatever_the_umask(cell: Path) -> None:
    old = os.umask(0o077)
    try:
        with cell_lock(cell):
            pass
    finally:
        os.umask(old)
    assert stat.S_IMODE(lock_path(cell.with_name("controller.toml")).stat().st_mode) == 0o666


@pytest.mark.parametrize("note", ["", "rubbish", "[1]", '{"pid": 1}', "\x00\xff" * 5000])
def test_an_unreadable_note_still_means_busy(cell: Path, note: str) -> None:
    with cell_lock(cell):
        lock_path(cell.with_name("controller.toml")).write_bytes(note.encode("latin-1"))
        with pytest.raises(CellBusy, match="in use by another process"), cell_lock(cell):
            pass


def test_a_full_disk_does_not_keep_anybody_from_the_robot(
    cell: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with cell_lock(cell):
        assert is_busy(cell)
    assert not is_busy(cell)


def test_a_link_in_place_of_the_lock_file_is_not_followed(cell: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    lock_path(cell.with_name("controller.toml")).symlink_to(victim)
    with pytest.raises(FileError, match="lock file cannot be opened"), cell_lock(cell):
        pass
    assert victim.read_text() == "precious"


def test_a_folder_that_takes_no_lock_file_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(FileError, match="lock file cannot be opened: it does not exist"),
        config_lock(tmp_path / "absent" / "controller.toml"),
    ):
        pass


def test_a_lock_file_that_may_not_be_opened_is_told(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", denied)
    with pytest.raises(FileError, match=r"permission denied.*mode 666"), cell_lock(cell):
        pass


def test_a_file_system_without_locks_is_told(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr("fcntl.flock", unsupported)
    with pytest.raises(FileError, match="cannot be locked: No locks available"), cell_lock(cell):
        pass


@pytest.mark.parametrize(
    "text", ["", "[controller]\n", "controller = 1\n", "[controller]\nconfig = 7\n", "=\n"]
)
def test_a_cell_file_without_a_config_is_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(FileError, match="names no controller config") as caught, cell_lock(path):
        pass
    assert caught.value.subject == str(path)


def test_an_absent_cell_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="does not exist"), cell_lock(tmp_path / "cell.toml"):
        pass
