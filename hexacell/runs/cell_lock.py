"""One process per cell: the process that moves the robot holds the cell's lock.

The lock is an advisory ``flock`` on a small file beside the controller's config. Everybody who moves this
robot shares that file; of several files each has a lock, as another cell may name one of them:

- A second cell file for the same robot, a copy or a link, names the same config and so the same lock.
- The technician and the scheduler are different users. With a lock in a folder of each user both could
  move the robot at once.
- The config itself cannot carry the lock: a write-back replaces it, and a later process would lock the new
  file while the old one is still held.

A config copied to another folder makes another lock; the controller and the serial ports then refuse
the second process.

The kernel releases the lock when the process ends, however it ends, so there are no stale locks. The file
stays; its content names the holder, for people only. Somebody may delete it all the same, and a second
process would then lock a new one. Therefore the holder has a name in the kernel as well, which nobody can
delete: the abstract address of a socket, made of the config's folder and name. It is known within one
computer; other systems than Linux have none.

Only the user who made the file may write it, whatever the umask is. All others open it for reading, which
is enough to lock it; they cannot leave their name in it, so a name counts only while its process lives.
"""

import errno
import fcntl
import getpass
import json
import logging
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path

from hexacell.errors import CellBusy, FileError
from hexacell.storage import atomic_files

_log = logging.getLogger(__name__)

_LONGEST_NOTE = 4096
_MODE = 0o644
_UNKNOWN = "another process"
# O_NOFOLLOW: in a shared folder a link must not turn the holder's note into a write to another file.
# O_NONBLOCK: a pipe in the place of the file would be waited for.
_FLAGS = os.O_NOFOLLOW | os.O_NONBLOCK


@contextmanager
def cell_lock(*config: Path) -> Iterator[None]:
    """Hold the cell whose controller reads these files until the context ends; never waits.

    Raises:
        CellBusy: another process, or this one, holds it; the message names pid, user, host and since.
        FileError: the lock file cannot be opened.
    """
    with ExitStack() as locks:
        for path in {lock_path(path): path for path in config}.values():
            locks.enter_context(_lock_of_file(path))
        yield


@contextmanager
def _lock_of_file(config: Path) -> Iterator[None]:
    descriptor = _open(lock_path(config))
    try:
        with atomic_files.os_errors("the cell cannot be locked", config):
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise CellBusy(
                    f"the cell is in use by {_holder(descriptor)}",
                    subject=config,
                    action="Wait until that has ended, or stop it",
                ) from error
        since = datetime.now(UTC).astimezone().isoformat(timespec="seconds")  # local time
        holder = {"pid": os.getpid(), "user": user_name(), "host": socket.gethostname(), "since": since}
        try:
            with _name_in_kernel(config):
                _note(descriptor, json.dumps(holder) + "\n")
                _log.info("this process holds the cell of %s", config)
                yield
        finally:
            _log.info("this process releases the cell of %s", config)
            _note(descriptor, "")
            # Explicit, because a forked child may still have the descriptor open.
            fcntl.flock(descriptor, fcntl.LOCK_UN)
    finally:
        os.close(descriptor)


def lock_holder(config: Path) -> str | None:
    """Who holds the cell, by the note in its lock; None if nobody does, or could not leave one.

    The lock itself is not tried: who takes it at that moment would find it held. Raises ``FileError``.
    """
    path = lock_path(config)
    try:
        descriptor = os.open(path, _FLAGS | os.O_RDONLY)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _cannot_open(path, error) from error
    try:
        holder = _holder(descriptor)
    finally:
        os.close(descriptor)
    return None if holder == _UNKNOWN else holder


def _name_in_kernel(config: Path) -> AbstractContextManager[object]:
    """Hold the cell's name where the system has such names; raises ``CellBusy`` if it is taken."""
    target = Path(os.path.realpath(config))
    folder = target.parent.stat()
    place = os.fsencode(f"{folder.st_dev}:{folder.st_ino}:{target.name}")
    named = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        if sys.platform == "linux":
            named.bind(f"\0hexacell-cell-{atomic_files.sha256(place)}")
    except OSError as error:
        named.close()
        if error.errno != errno.EADDRINUSE:
            return nullcontext()
        problem = "the cell is in use by another process, whose lock file was deleted"
        raise CellBusy(problem, subject=config, action="Wait until that has ended, or stop it") from error
    return named


def lock_path(config: Path) -> Path:
    """The lock file of a controller config: beside the file itself, links resolved."""
    target = Path(os.path.realpath(config))
    return target.with_name(f".{target.name}.hexacell-lock")


def _open(path: Path) -> int:
    try:
        descriptor = _created_or_opened(path)
    except OSError as error:
        raise _cannot_open(path, error) from error
    with suppress(OSError):  # a mode that does not depend on this process's umask
        os.fchmod(descriptor, _MODE)
    return descriptor


def _created_or_opened(path: Path) -> int:
    with suppress(FileExistsError):
        return os.open(path, _FLAGS | os.O_RDWR | os.O_CREAT | os.O_EXCL, _MODE)
    try:
        return os.open(path, _FLAGS | os.O_RDWR)
    except PermissionError:
        return os.open(path, _FLAGS | os.O_RDONLY)


def _cannot_open(path: Path, error: OSError) -> FileError:
    plain = atomic_files.os_error_to_file_error("the cell's lock file cannot be opened", path, error)
    if isinstance(error, PermissionError):
        plain.action = "Have the owner of the folder create it once, empty, with mode 644"
    return plain


def _note(descriptor: int, text: str) -> None:
    # Written before the file is truncated: a reader finds a complete first line at any moment.
    data = text.encode()
    with suppress(OSError):
        os.pwrite(descriptor, data, 0)
        os.ftruncate(descriptor, len(data))


def _holder(descriptor: int) -> str:
    """The holder in a few words, by its note."""
    try:
        note = json.loads(os.pread(descriptor, _LONGEST_NOTE, 0).splitlines()[0])
        words = "process {pid} of {user} on {host} since {since}".format(**note)
        return words if _is_alive(note) else _UNKNOWN
    except (OSError, LookupError, TypeError, ValueError, OverflowError):
        return _UNKNOWN


def _is_alive(note: dict[str, object]) -> bool:
    """Whether the process that left a note may still hold the cell; nobody knows of other computers'."""
    if note["host"] != socket.gethostname():
        return True
    try:
        os.kill(int(str(note["pid"])), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def user_name() -> str:
    """Who runs this process; by number where the name is not known."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"
