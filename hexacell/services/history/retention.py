"""Which old runs may be deleted, and their deletion.

A run stays, however old, if it wrote the controller's config or its proposal was applied: its result may be
in the controller now or be wanted back. So does one that is not over, whose proposal is open, or that
cannot be read.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.config.pending_write import held_config
from hexacell.runs.run_folder import runs_folder
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import PastRun, RunIndex
from hexacell.services.history.run_summary import is_applied_later
from hexacell.storage.atomic_files import os_errors

LEAVING = ".leaving-"
"""Begins the name of a folder that is being deleted; what a power cut leaves of it is deleted next time."""


class KeptFor(StrEnum):
    """Why an old run stays."""

    APPLIED = "it wrote the controller's config"
    PROPOSAL = "its proposal can still be applied"
    RESUMABLE = "it is not over"
    UNREADABLE = "it cannot be read"


@dataclass(frozen=True, slots=True)
class Retention:
    """The runs that ended before a time: those that may go, and those that stay, with the reason."""

    before: datetime
    leaving: tuple[PastRun, ...]
    kept: tuple[tuple[PastRun, KeptFor], ...]


def retention(cell: Cell, days: float, index: RunIndex | None = None) -> Retention:
    """What becomes of the runs that ended more than ``days`` ago; nothing is deleted.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    before = datetime.now(UTC) - timedelta(days=days)
    old = [run for run in past_runs(cell, index) if run.summary.ended is None or run.summary.ended < before]
    reasons = [(run, reason_to_keep(run)) for run in old]
    return Retention(
        before,
        leaving=tuple(run for run, reason in reasons if reason is None),
        kept=tuple((run, reason) for run, reason in reasons if reason is not None),
    )


def reason_to_keep(run: PastRun) -> KeptFor | None:
    """Why a run stays however old it is; None if it may go."""
    was = run.summary
    if not was.mode:
        return KeptFor.UNREADABLE
    if run.is_in_controller or was.has_written or is_applied_later(run.folder):
        return KeptFor.APPLIED
    if not was.is_over:
        return KeptFor.RESUMABLE
    return KeptFor.PROPOSAL if was.has_proposal else None


def delete_runs(cell: Cell, runs: Sequence[PastRun]) -> None:
    """Delete the folders of runs, while nothing else uses the cell.

    What has changed since the runs were listed is looked at again: one that must stay does.

    Raises:
        CellBusy: a run is going on.
        FileError: a folder cannot be deleted.
    """
    with held_config(*cell.config_paths):
        now = {run.name: run for run in past_runs(cell)}
        for run in runs:
            present = now.get(run.name)
            if present is not None and reason_to_keep(present) is None:
                _delete(run.folder.path)
        for rest in runs_folder(cell).glob(f"{LEAVING}*"):
            _remove(rest)


def _delete(path: Path) -> None:
    """Delete a folder in one step for all who list runs: half deleted it would be a damaged run."""
    leaving = path.with_name(f"{LEAVING}{path.name}")
    with os_errors("cannot be deleted", path):
        path.rename(leaving)
    _remove(leaving)


def _remove(path: Path) -> None:
    with os_errors("cannot be deleted", path):
        shutil.rmtree(path)
