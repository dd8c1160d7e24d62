"""Run folders: where every run of a cell is kept, what is in one, and what is derived from it."""

import itertools
import json
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from hexacell.cell.fields import Frozen, Name, first_mistake
from hexacell.cell.loader import Cell
from hexacell.errors import FileError, UsageError
from hexacell.storage.atomic_files import create_folder_durably, os_errors, read_bytes, read_text, write_own
from hexacell.storage.output_files import RUN_JOURNAL

CELL_FILE = "cell.toml"
MEASUREMENTS = "measurements.csv"
RESULT = "result.json"

_NAME = re.compile(r"""\s*name\s*=\s*(["'])(?P<name>[^"']*)\1""")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """One run on disk: its journal, and files derived from it for people and other programs."""

    path: Path

    @property
    def name(self) -> str:
        """What the run is called among those of its cell."""
        return self.path.absolute().name

    @property
    def siblings(self) -> Path:
        """The folder that it is in: that of all runs of its cell."""
        return self.path.absolute().parent

    @property
    def journal(self) -> Path:
        """The run itself; all else can be derived from it."""
        return self.path / RUN_JOURNAL

    @property
    def cell_file(self) -> Path:
        """The cell file's text as the run began, without passwords."""
        return self.path / CELL_FILE

    @property
    def attempts(self) -> Path:
        """The tries to begin it, where it was refused."""
        return self.path / "not-begun.json"

    @property
    def measurements(self) -> Path:
        """The records as a measurement file, for ``hexacell fit``."""
        return self.path / MEASUREMENTS

    @property
    def result(self) -> Path:
        """The identification, as ``hexacell fit --json`` prints it."""
        return self.path / RESULT

    @property
    def proposal(self) -> Path:
        """The change of the controller's config, for ``hexacell apply``."""
        return self.path / "proposal.json"

    @property
    def wire(self) -> Path:
        """What went over the wires; of a resumed run it has other names too (:func:`unused`)."""
        return self.path / "wire"

    def create(self, cell: Cell) -> None:
        """Make the folder and keep the cell file's text, without its passwords, in it.

        Raises:
            UsageError: it holds a run already.
            FileError: it cannot be made.
        """
        if self.journal.exists():
            raise UsageError(
                "this folder holds a run already", subject=self.path, action="Resume it, or name another"
            )
        create_folder_durably(self.path)
        write_own(self.cell_file, cell.text_without_secrets.encode())

    def write_result(self, document: dict[str, Any]) -> None:
        """Keep an identification; raises ``FileError``."""
        write_own(self.result, json.dumps(document, indent=1).encode() + b"\n")


def runs_folder(cell: Cell) -> Path:
    """Where a cell's runs are kept: beside its file."""
    return cell.path.parent / "runs" / cell.settings.name


def run_folders(cell: Cell) -> list[RunFolder]:
    """The folders of a cell's runs, by name."""
    folder = runs_folder(cell)
    return [RunFolder(path) for path in sorted(folder.iterdir())] if folder.is_dir() else []


def runs_folder_of_unreadable(path: Path) -> Path | None:
    """Where the runs of the cell file at ``path``, which has mistakes, are; None if its name is unknown."""
    every = path.parent / "runs"
    with suppress(FileError, ValidationError):
        lines = read_bytes(path).decode(errors="replace").splitlines()
        above = itertools.takewhile(lambda line: not line.lstrip().startswith("["), lines)
        name = next((one["name"] for one in map(_NAME.match, above) if one is not None), None)
        return every / TypeAdapter(Name).validate_python(name)
    present = [one for one in every.glob("*") if one.is_dir()]
    return present[0] if len(present) == 1 else None


def new_run(cell: Cell) -> RunFolder:
    """A folder for a run that begins now; nothing is made yet."""
    return new_run_in(runs_folder(cell))


def new_run_in(folder: Path) -> RunFolder:
    """A folder for a run that begins now, below the folder of a cell's runs."""
    return RunFolder(unused(folder / datetime.now(UTC).strftime("%Y-%m-%dT%H%M%SZ")))


def find_run(cell: Cell, named: str) -> RunFolder:
    """A run by its folder, or by its name within the cell's runs; raises ``UsageError``."""
    for path in (Path(named), runs_folder(cell) / named) if named.strip() else ():
        if RunFolder(path).journal.is_file():
            return RunFolder(path)
        if RunFolder(path).attempts.is_file():
            raise UsageError(
                f"the run '{named}' never began", action="`hexacell history CELL --json` says why"
            )
    raise UsageError(f"there is no run '{named}'", action=f"The cell's runs are in {runs_folder(cell)}")


def unused(path: Path) -> Path:
    """The path, or the first of ``<path>-2``, ``<path>-3`` ... that does not exist."""
    others = (path.with_name(f"{path.name}-{number}") for number in itertools.count(2))
    return next(one for one in itertools.chain([path], others) if not one.exists())


class StartAttempt(Frozen):
    """One try to begin a run, when it was refused (UTC), why, and the exit code of the reason."""

    at: datetime
    reason: str
    exit_code: int


class StartAttempts(Frozen):
    """All tries of one night, oldest first; a journal beside them says that the run began after them.

    ``mode`` is what the run was for.
    """

    mode: str
    attempts: tuple[StartAttempt, ...]

    @property
    def last(self) -> StartAttempt:
        """The latest try."""
        return self.attempts[-1]

    @property
    def line(self) -> str:
        """Why the run did not begin, in one line."""
        tries = len(self.attempts)
        often = "" if tries == 1 else f" ({tries} tries)"
        return f"not begun{often}: {' '.join(self.last.reason.split())}"


def read_attempts(folder: RunFolder) -> StartAttempts | None:
    """The tries that a run folder keeps; None where the run began at once; raises ``FileError``."""
    path = folder.attempts
    if not path.is_file():
        return None
    try:
        return StartAttempts.model_validate_json(read_text(path))
    except ValidationError as error:
        raise FileError(
            first_mistake(error, "the note"), subject=path, action="Delete it; it is a note only"
        ) from error


def note_attempt(folder: RunFolder, mode: str, attempt: StartAttempt) -> None:
    """Add a try to those that a run folder keeps; the folder is made; raises ``FileError``."""
    before = read_attempts(folder)
    attempts = StartAttempts(mode=mode, attempts=(*(before.attempts if before else ()), attempt))
    create_folder_durably(folder.path)
    write_own(folder.attempts, f"{attempts.model_dump_json(indent=1)}\n".encode())


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

    Hidden folders are no runs. Raises ``FileError``.

    A journal only grows, and every other file of a run is put in its place by a rename, which changes the
    time of its folder. The times of status changes count, which no program can set.
    """
    with os_errors("cannot be read", folder), suppress(FileNotFoundError), os.scandir(folder) as found:
        runs = [one for one in found if one.is_dir() and not one.name.startswith(".")]
        return {one.name: f"{_times(one.path)} {_times(f'{one.path}/{RUN_JOURNAL}')}" for one in runs}
    return {}


def _times(path: str) -> str:
    try:
        status = os.stat(path)  # noqa: PTH116 - half the time
    except OSError as error:
        return f"error {error.errno}"
    return f"{status.st_ino}:{status.st_size}:{status.st_mtime_ns}:{status.st_ctime_ns}"
