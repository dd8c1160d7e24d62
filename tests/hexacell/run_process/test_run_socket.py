"""The socket of a run: for its owner alone, one process at a time, and nothing left of it."""

import os
import shutil
import socket
import stat
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import CellBusy, FileError
from hexacell.run_process.run_socket import is_served, listening_socket, peer_of, socket_path


@pytest.fixture
def cell() -> Cell:
    return load_cell(bundled_config("simulated-hexaglide"))


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def test_only_its_owner_may_open_it_and_nothing_is_left_of_it(path) -> None:
    for umask in (0o000, 0o022, 0o077):
        before = os.umask(umask)
        try:
            with listening_socket(path):
                assert (mode(path.parent), mode(path)) == (0o700, 0o600)
                assert is_served(path)
        finally:
            os.umask(before)
        assert list(path.parent.iterdir()) == []
        assert not is_served(path)


def test_two_processes_do_not_serve_one_cell(path) -> None:
    with listening_socket(path):
        with pytest.raises(CellBusy, match="another process runs this cell"), listening_socket(path):
            pytest.fail("there are two")
        assert is_served(path), "the first one is as before"


def test_what_a_killed_process_left_is_replaced(path) -> None:
    path.parent.mkdir(mode=0o700)
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    assert path.exists()
    with listening_socket(path):
        assert is_served(path)


def test_a_folder_that_others_can_look_into_or_a_link_is_refused(path, tmp_path) -> None:
    def refused() -> None:
        with pytest.raises(FileError, match="is not yours alone"), listening_socket(path):
            pytest.fail("it is used")

    path.parent.mkdir()
    for permissions in (0o755, 0o770, 0o701):
        path.parent.chmod(permissions)
        refused()
    path.parent.rmdir()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    path.parent.symlink_to(elsewhere)
    refused()


def test_the_peer_is_known_by_the_kernel(path) -> None:
    with listening_socket(path) as listener, socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
        server, _ = listener.accept()
        with server:
            assert peer_of(server) == peer_of(client) == (os.getpid(), os.getuid())


def test_cell_files_of_one_robot_have_one_socket(cell, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    linked, copied = tmp_path / "linked", tmp_path / "copied"
    for folder in (linked, copied):
        folder.mkdir()
        shutil.copy(cell.path, folder)
    (linked / cell.config_path.name).symlink_to(cell.config_path)
    shutil.copy(cell.config_path, copied)
    same, other = (socket_path(load_cell(folder / cell.path.name)) for folder in (linked, copied))
    assert same == socket_path(cell)
    assert other != same
    assert same.parent == tmp_path / "hexacell"


def test_without_a_runtime_folder_it_is_in_that_of_temporary_files(cell, tmp_path_factory, monkeypatch):
    tmp_path = tmp_path_factory.mktemp("r")  # the path of a socket must be short
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "absent"))
    assert socket_path(cell).parent == tmp_path / f"hexacell-{os.getuid()}"
    long = tmp_path / ("x" * 100)
    long.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(long))
    with pytest.raises(FileError, match=r"too long\. Set XDG_RUNTIME_DIR"):
        socket_path(cell)
