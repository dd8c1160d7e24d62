"""One process at a time holds a cell, whoever made the lock file; a process that is gone holds none."""

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
from unittest.mock import Mock

import pytest

from hexacell.errors import CellBusy, ExitCode, FileError
from hexacell.runs.cell_lock import cell_lock, lock_path
from tests.signals import terminal_signals

HOLD = """
import sys
from pathlib import Path
from hexacell.runs.cell_lock import cell_lock
with cell_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "controller.toml"
    path.write_text("")
    return path


@contextmanager
def another_process(config: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that holds the cell until its standard input closes."""
    command = [sys.executable, "-c", HOLD, str(config)]
    with terminal_signals():
        holder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with holder as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process


def is_busy(config: Path) -> bool:
    try:
        with cell_lock(config):
            return False
    except CellBusy:
        return True


def test_another_process_is_refused_and_the_holder_is_named(config: Path) -> None:
    with another_process(config) as process, pytest.raises(CellBusy) as caught, cell_lock(config):
        pytest.fail("two processes hold the cell")
    words = str(caught.value)
    assert f"process {process.pid} of {getpass.getuser()} on {socket.gethostname()} since 20" in words
    assert re.search(r"since \d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d\d:\d\d", words)
    assert caught.value.exit_code is ExitCode.BUSY
    assert process.returncode == 0
    assert not is_busy(config)


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_process_leaves_no_stale_lock(config: Path, death: signal.Signals) -> None:
    with another_process(config) as process:
        assert is_busy(config)
        process.send_signal(death)
        process.wait()
        assert not is_busy(config)


def test_a_program_that_the_holder_started_does_not_keep_the_cell(config: Path) -> None:
    """A reload command, say, that is still there when its parent has been killed."""
    with cell_lock(config):
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        assert not is_busy(config)
    finally:
        child.communicate(b"\n")


def test_a_second_descriptor_does_not_keep_the_cell(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a forked child has one."""
    flock, copies = fcntl.flock, []

    def remember(descriptor: int, operation: int) -> None:
        flock(descriptor, operation)
        copies.append(os.dup(descriptor))

    with monkeypatch.context() as patch:
        patch.setattr(fcntl, "flock", remember)
        with cell_lock(config):
            pass
    assert copies
    assert not is_busy(config)
    for copy in copies:
        os.close(copy)


def test_a_deleted_lock_file_lets_no_second_process_in(config: Path) -> None:
    with another_process(config) as process:
        lock_path(config).unlink()
        for _ in range(2):  # the first try has made a new file
            with pytest.raises(CellBusy, match="whose lock file was deleted"), cell_lock(config):
                pytest.fail("two processes hold the cell")
        process.kill()
        process.wait()
        assert not is_busy(config)


def test_cells_beside_each_other_are_held_apart_and_links_to_one_are_the_same(config, tmp_path) -> None:
    (other := tmp_path / "other.toml").write_text("")
    with cell_lock(config):
        assert not is_busy(other)
    folder = tmp_path / "other"
    folder.mkdir()
    (folder / "linked.toml").symlink_to("../controller.toml")
    with cell_lock(config):
        assert is_busy(folder / "linked.toml")
        assert is_busy(folder / ".." / "controller.toml")


def test_a_write_back_does_not_open_the_lock_whose_file_stays_and_is_empty_when_free(config: Path) -> None:
    with cell_lock(config):
        config.with_name("new").write_text("new")
        config.with_name("new").replace(config)
        assert is_busy(config)
    path = lock_path(config)
    with cell_lock(config):
        assert str(os.getpid()) in path.read_text()
        inode = path.stat().st_ino
    assert path.read_text() == ""
    assert path.stat().st_ino == inode


@pytest.mark.parametrize("umask", [0o077, 0])
def test_all_users_can_open_the_lock_file_and_only_its_maker_can_write_it(config: Path, umask: int) -> None:
    old = os.umask(umask)
    try:
        with cell_lock(config):
            pass
    finally:
        os.umask(old)
    assert stat.S_IMODE(lock_path(config).stat().st_mode) == 0o644


@contextmanager
def read_only(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The lock file belongs to another user, who alone may write it."""
    open_file = os.open

    def denied(path: Path, flags: int, *mode: int) -> int:
        if flags & os.O_CREAT:
            raise FileExistsError(17, "File exists")
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied")
        return open_file(path, flags, *mode)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", denied)
        yield


def test_a_user_who_may_only_read_the_lock_file_excludes_others(config, monkeypatch) -> None:
    """The technician made it, and the scheduler is another user."""
    lock_path(config).touch(mode=0o644)
    with read_only(monkeypatch), cell_lock(config):
        assert is_busy(config)
    assert not is_busy(config)
    with another_process(config), read_only(monkeypatch):
        assert is_busy(config)


def test_the_name_of_a_process_that_has_died_is_not_given(config, monkeypatch) -> None:
    with another_process(config) as process:
        process.kill()
        process.wait()
    assert str(process.pid) in lock_path(config).read_text()
    with (
        read_only(monkeypatch),
        cell_lock(config),
        pytest.raises(CellBusy, match="in use by another process"),
        cell_lock(config),
    ):
        pass


def test_a_pipe_in_place_of_the_lock_file_is_not_waited_for(config, monkeypatch) -> None:
    os.mkfifo(lock_path(config))
    with read_only(monkeypatch), cell_lock(config):
        assert is_busy(config)


@pytest.mark.parametrize("note", ["", "rubbish", "[1]", '{"pid": 1}', "\x00\xff" * 5000])
def test_a_held_lock_with_an_unreadable_note_is_reported_as_busy(config: Path, note: str) -> None:
    with cell_lock(config):
        lock_path(config).write_bytes(note.encode("latin-1"))
        with pytest.raises(CellBusy, match="in use by another process"), cell_lock(config):
            pass


def test_a_full_disk_does_not_prevent_locking(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "pwrite", Mock(side_effect=OSError(28, "No space left on device")))
    with cell_lock(config):
        assert is_busy(config)
    assert not is_busy(config)


def test_a_link_in_place_of_the_lock_file_is_not_followed(config: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    lock_path(config).symlink_to(victim)
    with pytest.raises(FileError, match="lock file cannot be opened"), cell_lock(config):
        pass
    assert victim.read_text() == "precious"


def test_a_file_system_without_locks_is_reported(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcntl.flock", Mock(side_effect=OSError(37, "No locks available")))
    with pytest.raises(FileError, match="cannot be locked: No locks available"), cell_lock(config):
        pass
