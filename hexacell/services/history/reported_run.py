"""A run as its report needs it: from its folder alone, so that the report is the same at any time."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from hexacell.campaign.time_model import Seconds
from hexacell.cell.loader import load_cell
from hexacell.cell.model import CellSettings
from hexacell.config.change import AFTER, BEFORE
from hexacell.errors import FileError, UsageError
from hexacell.runs.run_folder import CELL_FILE, MEASUREMENTS, RESULT, RunFolder
from hexacell.services.history.journal_soundness import read_sound
from hexacell.storage import atomic_files
from hexacell.storage.output_files import RUN_JOURNAL
from procedures.journal.time_spent import time_spent
from procedures.run.state import RunState
from procedures.steps import events

FINGERPRINTED = (RUN_JOURNAL, CELL_FILE, MEASUREMENTS, RESULT, BEFORE, AFTER)
"""Files of a run folder that the report vouches for, where they are there; of a config every file."""

IDENTIFIER_DIGITS = 12


@dataclass(frozen=True, eq=False)
class ReportedRun:
    """One run that is over, or was interrupted.

    Attributes:
        settings: the cell file as it was when the run began.
        began, ended: when its first and last event were written, UTC.
        spent: what the time in between was spent on.
        document: the identification as ``fit --json`` has it; empty without one.
        fingerprints: SHA-256 of the files of the folder, by their names.
    """

    folder: RunFolder
    settings: CellSettings
    state: RunState
    started: events.RunStarted
    began: datetime
    ended: datetime
    spent: Seconds
    document: Mapping[str, Any]
    fingerprints: Mapping[str, str]

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.path.resolve().name

    @property
    def identifier(self) -> str:
        """Unique name of this report: cell, run, and a part of the journal's fingerprint."""
        digits = self.fingerprints[RUN_JOURNAL][:IDENTIFIER_DIGITS]
        return f"{self.settings.name} / {self.name} / {digits}"


def reported_run(run: Path) -> ReportedRun:
    """The run in a folder, which is over, or was interrupted.

    Raises:
        UsageError: it is no run folder, or nothing happened in the run.
        FileError: one of its files cannot be read, or is damaged.
    """
    folder = RunFolder(run)
    if not folder.journal.is_file() and folder.attempts.is_file():
        action = "`hexacell history CELL --json` says why"
        raise UsageError("this run never began", subject=run, action=action)
    if not folder.journal.is_file():
        raise UsageError("this is no run folder", subject=run, action="`hexacell history CELL` lists them")
    settings = load_cell(folder.cell_file).settings
    entries, state = read_sound(folder, settings)
    if state.started is None:
        raise UsageError("nothing happened in this run", subject=run, action="Name another")
    further = (path.name for name in (BEFORE, AFTER) for path in sorted(run.glob(f"{name}-*")))
    contents = {name: atomic_files.read_if_present(run / name) for name in (*FINGERPRINTED, *further)}
    return ReportedRun(
        folder=folder,
        settings=settings,
        state=state,
        started=state.started,
        began=entries[0].at,
        ended=entries[-1].at,
        spent=time_spent(entries, settings.timing),
        document=_document(folder.result),
        fingerprints={
            name: atomic_files.sha256(data) for name, data in contents.items() if data is not None
        },
    )


def _document(path: Path) -> Mapping[str, Any]:
    if (data := atomic_files.read_if_present(path)) is None:
        return {}
    try:
        found = json.loads(data)
    except ValueError as error:
        raise FileError(
            f"is damaged: {error}", subject=path, action="`hexacell fit` makes it again"
        ) from error
    if not isinstance(found, dict):
        raise FileError("is no result of an identification", subject=path, action="Name another run")
    return found
