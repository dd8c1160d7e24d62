"""What an archive keeps: documents derived from run folders, each with the stamp of its folder."""

import os
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from hexacell.errors import FileError
from hexacell.runs.run_folder import JOURNAL
from hexacell.storage.atomic_files import os_errors


class DocumentKind(StrEnum):
    """What the archive keeps of a run; of a cell, under no run's name, its status for others."""

    SUMMARY = "summary"
    RESULT = "result"
    EVIDENCE = "evidence"
    CELL = "cell"


@dataclass(frozen=True, slots=True)
class StampedDocument:
    """A document that was derived from a run folder when that had the ``stamp``."""

    stamp: str
    content: bytes


class ArchiveUnavailable(FileError):
    """The archive cannot be used; what is asked of it must be read from the folders."""


def folder_stamps(folder: Path) -> dict[str, str]:
    """The stamp of each run folder in ``folder``, by name; empty where ``folder`` does not exist.

    Hidden folders are no runs.

    A journal only grows, and every other file of a run is put in its place by a rename, which changes the
    time of its folder. The times of status changes count, which no program can set.

    Raises:
        FileError: the folder cannot be read.
    """
    with os_errors("cannot be read", folder), suppress(FileNotFoundError), os.scandir(folder) as found:
        runs = [one for one in found if one.is_dir() and not one.name.startswith(".")]
        return {one.name: f"{_times(one.path)} {_times(f'{one.path}/{JOURNAL}')}" for one in runs}
    return {}


def _times(path: str) -> str:
    try:
        status = os.stat(path)  # noqa: PTH116 - half the time
    except OSError as error:
        return f"error {error.errno}"
    return f"{status.st_ino}:{status.st_size}:{status.st_mtime_ns}:{status.st_ctime_ns}"
