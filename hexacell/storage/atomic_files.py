"""Whole files: read with plain errors, replaced in one step that survives a power cut.

A replacement is written to a temporary file in the same folder, synced to the disk, and renamed over
the old file; then the folder is synced too. POSIX ``rename`` is atomic: a reader gets the old content or
the new one, never a mixture. A process that dies in between leaves its temporary file,
``.hexacell-*.tmp``; the next process that holds the cell removes it.

What cannot be read or written is a ``FileError`` with the reason and what to do.
"""

import errno
import hashlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

from hexacell.errors import FileError

NOT_FOR_OTHERS = 0o002
"""What no file or folder that the program makes is: writable by everybody, whatever the umask."""

FOR_EVERYBODY = 0o444
"""To be read by everybody."""

LARGEST_BYTES = 200_000_000
"""Most bytes of any file that is read as a whole: no run and no history comes near it."""

BYTE_ORDER_MARK = "\ufeff"

SHORTAGES = {
    errno.EMFILE: ("this process may open no more files", "Raise the limit (ulimit -n)"),
    errno.ENFILE: ("the computer can open no more files", "End other programs"),
    errno.ENOMEM: ("the memory is used up", "End other programs"),
}
"""What the computer lacks, and what to do, whatever file or device is concerned."""

_REASONS: dict[int, tuple[str, str]] = SHORTAGES | {
    errno.ENOENT: ("it does not exist", "Check the path"),
    errno.ENOTDIR: ("a part of the path is not a folder", "Check the path"),
    errno.EISDIR: ("it is a folder", "Name a file"),
    errno.EEXIST: ("something else has that name", "Choose another name"),
    errno.ELOOP: ("its symbolic links form a loop", "Repair the link"),
    errno.EACCES: ("permission denied", "Run as another user, or change the permissions"),
    errno.EPERM: ("permission denied", "Run as another user, or change the permissions"),
    errno.EROFS: ("the file system is read-only", "Mount it writable, or move the file"),
    errno.ENOSPC: ("the disk is full", "Free some space and try again"),
    errno.EDQUOT: ("the disk quota is used up", "Free some space and try again"),
    errno.EFBIG: ("it may not become larger", "Raise the limit on the size of files (ulimit -f)"),
    errno.EBUSY: ("the file is a mount point", "Mount its folder instead of the single file"),
    errno.EIO: ("the disk reports an error", "Check the disk"),
}


def sha256(data: bytes) -> str:
    """The SHA-256 of ``data`` in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def require_size(path: Path, largest_bytes: int = LARGEST_BYTES) -> None:
    """Make sure of a regular file that may be read as a whole, before any of it is; raises ``FileError``.

    A pipe or a device is refused, as reading it could block.
    """
    with os_errors("cannot be read", path):
        status = path.stat()
    _require_regular(path, status)
    require_length(path, status.st_size, largest_bytes)


def require_length(path: Path, length: int, largest_bytes: int = LARGEST_BYTES) -> None:
    """Raise ``FileError`` if a file of so many bytes is not read."""
    if length > largest_bytes:
        size = f"{length / 1e6:.1f} MB, and at most {largest_bytes / 1e6:g} MB are read"
        raise FileError(f"is too large: {size}", subject=path, action="Name another file, or split it")


def read_bytes(path: Path, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """The content of a regular file that is not larger than that; raises ``FileError``."""
    require_size(path, largest_bytes)
    with os_errors("cannot be read", path), path.open("rb") as stream:
        data = stream.read(largest_bytes + 1)
    require_length(path, len(data), largest_bytes)  # it may have grown
    return data


def read_end(stream: BinaryIO, most_bytes: int) -> str:
    """The end of what programs said, as text; they may have said any amount."""
    stream.seek(-min(most_bytes, stream.seek(0, os.SEEK_END)), os.SEEK_END)
    return stream.read(most_bytes).decode(errors="replace").strip()


def read_if_present(path: Path) -> bytes | None:
    """The content of a regular file, None if there is no such file."""
    with os_errors("cannot be read", path):
        try:
            path.lstat()
        except FileNotFoundError:
            return None
    return read_bytes(path)


def read_text(path: Path, largest_bytes: int = LARGEST_BYTES) -> str:
    """The content of a UTF-8 file, with its line ends but no byte order mark.

    Raises:
        FileError: it cannot be read, is no text, or is larger than ``largest_bytes``.
    """
    return decode_utf8(read_bytes(path, largest_bytes), path).removeprefix(BYTE_ORDER_MARK)


def decode_utf8(data: bytes, path: Path) -> str:
    """``data``, the content of ``path``, as UTF-8 text; the error has the line that is not."""
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        action = "Save it as UTF-8"
        raise FileError("the file is not UTF-8 text", subject=path, line=line, action=action) from error


def write_atomically(
    path: Path,
    data: bytes,
    *,
    expected: bytes | None = None,
    like: Path | None = None,
    for_everybody: bool = False,
) -> None:
    """Replace the content of ``path``, or create it, in one step that survives a power cut.

    A symbolic link is kept; the file it points to is replaced. Mode, owner and extended attributes (with
    access control lists) are kept; where the owner cannot be kept, nothing is written. If ``expected`` is
    given, the file must hold exactly that just before it is replaced. A new file has the permissions of
    ``like``, if that is given, but is never writable by everybody; with ``for_everybody`` all may read it,
    whatever the umask.

    Raises:
        FileError: the file is unchanged, and no temporary file is left. Only if the message says that the
            file was replaced, it holds the new content, but a power cut may undo that.
    """
    with os_errors("cannot be written and is unchanged", path):
        target = _resolved(path)
        with _temporary_beside(target) as temporary:
            mode = 0o666 if like is None else stat.S_IMODE(like.stat().st_mode)
            new_mode = mode & 0o666 & ~NOT_FOR_OTHERS
            _write_like(target, temporary, data, new_mode, for_everybody=for_everybody)
            is_size_right = expected is None or target.stat().st_size == len(expected)
            if expected is not None and not (is_size_right and target.read_bytes() == expected):
                problem = "the file was changed by somebody else just now and is left unchanged"
                raise FileError(problem, subject=target, action="Run again")
            os.replace(temporary, target)  # noqa: PTH105 - named as the system call it is
    with os_errors("was replaced, but a power cut may undo that", path):
        sync_folder(target.parent)


def write_own(path: Path, data: bytes, *, like: Path | None = None) -> None:
    """Replace or create a file in a folder that may come from elsewhere, through no link; ``FileError``."""
    require_no_link(path)
    write_atomically(path, data, like=like)


def require_no_link(path: Path) -> None:
    """Raise ``FileError`` if a file of the program's own is a link."""
    with os_errors("cannot be written and is unchanged", path):
        if path.is_symlink():
            raise FileError("is a link, which is not allowed here", subject=path, action="Remove it")


def require_replaceable(path: Path) -> None:
    """Raise ``FileError`` if :func:`write_atomically` is known to refuse the file."""
    with os_errors("cannot be written and is unchanged", path):
        target = _resolved(path)
        if _status(target) is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        if not os.access(target.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if target.stat().st_dev != target.parent.stat().st_dev:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))


def require_creatable(path: Path) -> None:
    """Raise ``FileError`` if a new file at ``path`` is known to be refused."""
    with os_errors("no file can be made there", path):
        folder = _resolved(path).parent
        if not stat.S_ISDIR(folder.stat().st_mode):
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        with tempfile.NamedTemporaryFile(prefix=".hexacell-", suffix=".tmp", dir=folder):
            pass


def sync_folder(folder: Path) -> None:
    """Sync the names in ``folder`` to the disk; raises ``OSError``.

    Some network file systems do not support this and report ``EINVAL``, which is ignored.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
    finally:
        os.close(descriptor)


def create_folder_durably(folder: Path) -> None:
    """Create ``folder`` and its missing parents, synced to the disk."""
    with os_errors("the folder cannot be made", folder):
        absent = [parent for parent in (folder, *folder.parents) if not parent.exists()]
        for parent in absent[::-1] or [folder]:
            parent.mkdir(mode=0o777 & ~NOT_FOR_OTHERS, exist_ok=True)
        # Each folder is a name in its parent: if one name is lost, all below it is lost too.
        for created in absent or [folder]:
            sync_folder(created.parent)


def os_error_to_file_error(what: str, path: Path, error: OSError) -> FileError:
    """``error`` in plain words: what failed, with which file, why, and what to do."""
    why, action = _REASONS.get(error.errno or 0, (error.strerror or str(error), "Try again"))
    return FileError(f"{what}: {why}", subject=path, action=action)


def shortage(error: Exception) -> FileError | None:
    """An error that nobody foresaw as what the computer lacks, if it is one of that."""
    if isinstance(error, FileNotFoundError) and error.filename is None:  # of tempfile
        action = "Free some space there, or name another folder in TMPDIR"
        return FileError("there is no folder for temporary files", action=action)
    number = error.errno if isinstance(error, OSError) else None
    if number not in {*SHORTAGES, errno.ENOSPC, errno.EDQUOT}:
        return None
    why, action = _REASONS[number]
    return FileError(why, subject=getattr(error, "filename", None), action=action)


@contextmanager
def os_errors(what: str, path: Path) -> Iterator[None]:
    """Make a ``FileError`` of every ``OSError`` within this context: ``what`` failed with ``path``."""
    try:
        yield
    except OSError as error:
        raise os_error_to_file_error(what, path, error) from error


def _resolved(path: Path) -> Path:
    try:
        # Strict: otherwise a link that cannot be read for a moment would itself be replaced.
        return Path(os.path.realpath(path, strict=True))
    except FileNotFoundError:
        return Path(os.path.realpath(path))


def remove_stale_temporaries(path: Path) -> None:
    """Remove the temporary files of processes that died in :func:`write_atomically`.

    Those of the file ``path``, or all in it if it is a folder. The caller must be the only writer there: a
    temporary file that another process is writing looks the same.
    """
    target = _resolved(path)
    folder, own = (target, "*") if target.is_dir() else (target.parent, f"{_mark(target)}-*")
    for temporary in folder.glob(f".hexacell-{own}.tmp"):
        with suppress(OSError):  # it does no harm, as no program reads it
            temporary.unlink()


def _mark(target: Path) -> str:
    """What names a file's temporaries; the file's own name may already have the greatest length."""
    return sha256(os.fsencode(target.name))[:8]


@contextmanager
def _temporary_beside(target: Path) -> Iterator[Path]:
    temporary = target.with_name(f".hexacell-{_mark(target)}-{secrets.token_hex(8)}.tmp")
    try:
        yield temporary
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _write_like(target: Path, temporary: Path, data: bytes, new_mode: int, *, for_everybody: bool) -> None:
    status = _status(target)
    # Who may not read the old file must not read the new one, not even while it is written.
    mode = new_mode if status is None else 0o600
    with open(temporary, "xb", opener=partial(os.open, mode=mode)) as stream:
        stream.write(data)
        stream.flush()
        if status is not None:
            _keep_attributes(temporary, target, status)
        elif for_everybody:
            os.fchmod(stream.fileno(), stat.S_IMODE(os.fstat(stream.fileno()).st_mode) | FOR_EVERYBODY)
        os.fsync(stream.fileno())


def _status(target: Path) -> os.stat_result | None:
    try:
        status = target.stat()
    except FileNotFoundError:
        return None
    _require_regular(target, status)
    # A rename needs write permission for the folder only; a protected file must not be replaced.
    if not os.access(target, os.W_OK, effective_ids=os.access in os.supports_effective_ids):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return status


def _require_regular(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise FileError("this is not a file", subject=path, action="Check the path")


def _keep_attributes(temporary: Path, target: Path, status: os.stat_result) -> None:
    own = temporary.stat()
    if (own.st_uid, own.st_gid) != (status.st_uid, status.st_gid):
        try:
            os.chown(temporary, status.st_uid, status.st_gid)
        except PermissionError as error:
            raise FileError(
                f"the file belongs to user {status.st_uid}, group {status.st_gid}, and replacing it would "
                "change that; it is unchanged",
                subject=target,
                action="Run as its owner",
            ) from error
    shutil.copystat(target, temporary)  # the mode, and extended attributes where there are any
    os.utime(temporary)
