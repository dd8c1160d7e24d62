"""A text file to which lines are only ever added: each is on the disk before the next is begun.

A power cut or a full disk can tear the last line only. The next one begins on a line of its own, so a torn
one costs no other.
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from hexacell.errors import FileError
from hexacell.storage import atomic_files

# A link would lead what is appended to another file; a pipe would be waited for.
_FLAGS = os.O_RDWR | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
_NEW_FILE = 0o644
_FOR_GROUP = 0o020


def append_line(path: Path, line: bytes) -> None:
    """Add a line, given without its line feed; one process at a time may do that.

    Whoever may put files into the folder as a member of its group may add lines to a new file, too.

    Raises:
        FileError: the line is not in the file.
    """
    try:
        descriptor, is_new = _opened(path)
        try:
            if is_new:
                _share(descriptor, path.parent)
            _append(descriptor, path, line + b"\n")
        finally:
            os.close(descriptor)
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be written", path, error) from error


def _opened(path: Path) -> tuple[int, bool]:
    """A descriptor, and whether the file is new."""
    with suppress(FileExistsError):
        return os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, _NEW_FILE), True
    return os.open(path, _FLAGS), False


def _share(descriptor: int, folder: Path) -> None:
    with suppress(OSError):
        os.fchmod(descriptor, _NEW_FILE | (folder.stat().st_mode & _FOR_GROUP))
        atomic_files.sync_folder(folder)


def _append(descriptor: int, path: Path, line: bytes) -> None:
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        raise FileError("this is not a file", subject=path, action="Move it away")
    is_torn = status.st_size > 0 and os.pread(descriptor, 1, status.st_size - 1) != b"\n"
    rest = b"\n" + line if is_torn else line
    try:
        while rest:  # a disk that is nearly full takes a part first
            rest = rest[os.write(descriptor, rest) :]
        os.fsync(descriptor)
    except OSError:
        with suppress(OSError):
            os.ftruncate(descriptor, status.st_size)
        raise
