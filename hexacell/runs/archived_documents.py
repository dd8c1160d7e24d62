"""What an archive keeps: documents derived from run folders, each with the stamp of its folder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from hexacell.errors import FileError
from hexacell.runs.run_folder import JOURNAL
from hexacell.storage.atomic_files import os_error_to_file_error


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
    try:
        with os.scandir(folder) as found:
            return {one.name: _stamp(one) for one in found if one.is_dir() and not one.name.startswith(".")}
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise os_error_to_file_error("cannot be read", folder, error) from error


def _stamp(entry: os.DirEntry[str]) -> str:
    return f"{_times(entry.path)} {_times(os.path.join(entry.path, JOURNAL))}"  # noqa: PTH118 - half the time


def _times(path: str) -> str:
    try:
        status = os.stat(path)  # noqa: PTH116 - likewise
    except OSError as error:
        return f"error {error.errno}"
    return f"{status.st_ino}:{status.st_size}:{status.st_mtime_ns}:{status.st_ctime_ns}"
