"""The Unix socket by which a run is reached: only its owner may open it.

It is in a folder of mode 0700 under ``XDG_RUNTIME_DIR``, or under the folder for temporary files where
there is none. Its name follows from the controller's config, as that of the cell's lock does: cell files
for the same robot find the same run.
"""

import fcntl
import hashlib
import os
import socket
import stat
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.errors import CellBusy, FileError
from hexacell.storage.atomic_files import os_errors

LONGEST_SOCKET_PATH = 107
"""Bytes: what Linux takes."""

_PEER = struct.Struct("3i")


def socket_path(cell: Cell) -> Path:
    """Where the socket of a cell's run is; raises ``FileError`` where none can be."""
    config = os.path.realpath(cell.config_path)
    name = hashlib.sha256(os.fsencode(config)).hexdigest()[:16]
    path = _runtime_folder() / f"{name}.sock"
    if len(os.fsencode(path)) > LONGEST_SOCKET_PATH:
        raise FileError(
            "the path of a socket there would be too long",
            subject=path.parent,
            action="Set XDG_RUNTIME_DIR to a folder with a shorter path",
        )
    return path


@contextmanager
def listening_socket(path: Path) -> Iterator[socket.socket]:
    """A socket that listens there; it is removed at the end of this context.

    Raises:
        CellBusy: another process listens there.
        FileError: it cannot be made.
    """
    with os_errors("the folder for the socket cannot be made", path.parent):
        with suppress(FileExistsError):
            path.parent.mkdir(mode=0o700)
        found = path.parent.lstat()
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if not is_ours or stat.S_IMODE(found.st_mode) & 0o077:
        raise FileError(
            "this folder for sockets is not yours alone",
            subject=path.parent,
            action="Remove it, or set XDG_RUNTIME_DIR to a folder of yours with mode 700",
        )
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        with _alone_in(path.parent):
            if is_served(path):
                problem = "another process runs this cell"
                raise CellBusy(problem, subject=path, action="See it with `hexacell tui`")
            with os_errors("the socket of the run cannot be made", path):
                path.unlink(missing_ok=True)  # of a process that was killed
                os.fchmod(listener.fileno(), 0o600)
                listener.bind(str(path))
                listener.listen()
        try:
            yield listener
        finally:
            path.unlink(missing_ok=True)


def is_served(path: Path) -> bool:
    """Whether a process listens there."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        return probe.connect_ex(str(path)) == 0


def peer_of(connection: socket.socket) -> tuple[int, int]:
    """Process and user at the other end, by the kernel's word."""
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
    process, user, _ = _PEER.unpack(credentials)
    return process, user


def _runtime_folder() -> Path:
    stated = os.environ.get("XDG_RUNTIME_DIR")
    if stated and Path(stated).is_dir():
        return Path(stated) / "hexacell"
    return Path(tempfile.gettempdir()) / f"hexacell-{os.getuid()}"


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """No other process makes a socket there meanwhile; no lock is left."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
