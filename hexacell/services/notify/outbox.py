"""Notices that are still to be told, one file each: what was kept survives a power cut.

A notice is removed once who is told has taken it, so that one is told twice after a power cut in between,
with the same ``id``. The files have no address and no secret.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta
from hashlib import sha256
from pathlib import Path

from pydantic import ValidationError

from hexacell.errors import FileError
from hexacell.services.notify.notice import PendingNotice
from hexacell.storage import atomic_files

FOLDER = ".outbox"
"""Beside a cell's runs; hidden folders are no runs."""

MOST_KEPT = 100
LONGEST_KEPT = timedelta(days=7)
LARGEST_NOTICE_BYTES = 100_000


class NoticeOutbox:
    """The notices of one cell; ``folder`` has its runs and is made when it is needed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER

    def keep(self, pending: PendingNotice) -> None:
        """Keep a notice until it is told; the same one again changes nothing.

        Raises:
            FileError: it cannot be kept, as on a full disk.
        """
        atomic_files.create_folder_durably(self._folder)
        atomic_files.write_atomically(self._file(pending), pending.model_dump_json().encode() + b"\n")

    def forget(self, pending: PendingNotice) -> None:
        """It has been told.

        Raises:
            FileError: it cannot be removed; it will be told once more.
        """
        path = self._file(pending)
        try:
            path.unlink(missing_ok=True)
            atomic_files.sync_folder(self._folder)
        except FileNotFoundError:
            return
        except OSError as error:
            raise atomic_files.os_error_to_file_error("cannot be removed", path, error) from error

    def pending(self) -> tuple[PendingNotice, ...]:
        """What is still to be told, the oldest first; what no program can read is left out.

        Raises:
            FileError: the folder cannot be read.
        """
        try:
            paths = sorted(self._folder.glob("*.json"))
        except OSError as error:
            raise atomic_files.os_error_to_file_error("cannot be read", self._folder, error) from error
        found = [one for path in paths if (one := _read(path)) is not None]
        return tuple(sorted(found, key=lambda one: (one.notice.at, one.notice.id, one.to)))

    def drop_old(self, now: datetime) -> int:
        """Give up what is too old or too much, the oldest first; gives how many.

        Raises:
            FileError: they cannot be removed.
        """
        waiting = self.pending()
        young = [one for one in waiting if one.notice.at > now - LONGEST_KEPT]
        kept = young[-MOST_KEPT:]
        for one in waiting:
            if one not in kept:
                self.forget(one)
        self._remove_remains(now)
        return len(waiting) - len(kept)

    @contextmanager
    def held(self) -> Iterator[bool]:
        """Whether no other process sends from here; none does while this is held."""
        try:
            descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except FileNotFoundError:
            yield True
            return
        except OSError as error:
            raise atomic_files.os_error_to_file_error("cannot be read", self._folder, error) from error
        try:
            yield _locked(descriptor)
        finally:
            os.close(descriptor)

    def _remove_remains(self, now: datetime) -> None:
        """Files that no program reads, as those of a process that died while it wrote them."""
        damaged = [path for path in self._folder.glob("*.json") if _read(path) is None]
        for path in (*self._folder.glob(".hexacell-*.tmp"), *damaged):
            with suppress(OSError):
                if path.stat().st_mtime < (now - LONGEST_KEPT).timestamp():
                    path.unlink()

    def _file(self, pending: PendingNotice) -> Path:
        return self._folder / f"{notice_id(pending.notice.id, pending.to)}.json"


def notice_id(*parts: str) -> str:
    """A name for what these words tell, the same each time."""
    return sha256("\0".join(parts).encode()).hexdigest()[:32]


def _locked(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _read(path: Path) -> PendingNotice | None:
    try:
        return PendingNotice.model_validate_json(atomic_files.read_text(path, LARGEST_NOTICE_BYTES))
    except (FileError, ValidationError):
        return None
