"""The runs of a cell so far: all of them, two compared, trends of their parameters, old ones deleted.

What a run was is read from its folder once and kept in the cell's archive (:mod:`.run_index`); what reads
journals is imported only where a run is not in the archive yet.

A run stays, however old, if it wrote the controller's config or its proposal was applied: its result may be
in the controller now or be wanted back. So does one that is not over, whose proposal is open, or that
cannot be read.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.cell.loader import Cell
from hexacell.config.layout import fingerprint
from hexacell.config.pending_write import held_config
from hexacell.runs.run_folder import DocumentKind, RunFolder, find_run, runs_folder
from hexacell.services.history.run_index import PastRun, RunIndex, RunSummary
from hexacell.storage.atomic_files import os_errors

if TYPE_CHECKING:
    from hexacell.results.run_comparison import ParameterTrend, RunComparison


def past_runs(cell: Cell, index: RunIndex | None = None) -> tuple[PastRun, ...]:
    """All runs of a cell, the newest first; those that cannot be read come last, with the reason.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    config, folder = fingerprint(*cell.config_paths), runs_folder(cell)
    found = (index or RunIndex(cell)).documents(DocumentKind.SUMMARY, RunSummary, _summary)
    runs = [
        PastRun(RunFolder(folder / name), summary, summary.written_sha256 == config)
        for name, summary in found.items()
    ]
    return tuple(sorted(runs, key=_age_rank, reverse=True))


def _summary(folder: RunFolder) -> RunSummary:
    from hexacell.services.history.run_summary import run_summary  # noqa: PLC0415 - only what is not kept yet

    return run_summary(folder)


def compare_runs(cell: Cell, before: str, after: str) -> tuple[RunFolder, RunFolder, RunComparison]:
    """Two runs, by folder or name, and what changed from one to the other.

    Raises:
        UsageError: there is no such run, it identified nothing, or their frames differ.
    """
    from hexacell.results.run_comparison import compare_results  # noqa: PLC0415 - only where runs are compared
    from hexacell.services.history.run_summary import require_result, state_of  # noqa: PLC0415

    one, other = (find_run(cell, named) for named in (before, after))
    results = (require_result(state_of(run), run.name) for run in (one, other))
    return one, other, compare_results(cell.settings.mechanism.parameters, *results)


def parameter_trends(
    cell: Cell, runs: Iterable[PastRun], index: RunIndex | None = None
) -> tuple[ParameterTrend, ...]:
    """The trend of each parameter over the runs whose identification converged, oldest first.

    Raises:
        UsageError: they have different frame conventions.
    """
    from hexacell.results.result import IdentificationResult  # noqa: PLC0415 - only where results are read
    from hexacell.results.run_comparison import trends  # noqa: PLC0415 - likewise
    from hexacell.services.history.run_summary import result_of_its_own, state_of  # noqa: PLC0415 - likewise

    def read(folder: RunFolder) -> IdentificationResult | None:
        return result_of_its_own(state_of(folder))

    identified = [run for run in sorted(runs, key=_age_rank) if run.summary.has_result]
    found = (index or RunIndex(cell)).documents(
        DocumentKind.RESULT, IdentificationResult, read, [run.name for run in identified]
    )
    results = [
        (run.summary.ended, found[run.name])
        for run in identified
        if run.summary.ended is not None and run.name in found and found[run.name].converged
    ]
    return trends(cell.settings.mechanism.parameters, results)


def _age_rank(run: PastRun) -> tuple[bool, float, str]:
    ended = run.summary.ended
    return ended is not None, 0.0 if ended is None else ended.timestamp(), run.name


LEAVING = ".leaving-"
"""Begins the name of a folder that is being deleted; what a power cut leaves of it is deleted next time."""


class KeptFor(StrEnum):
    """Why an old run stays."""

    APPLIED = "it wrote the controller's config"
    PROPOSAL = "its proposal can still be applied"
    RESUMABLE = "it is not over"
    UNREADABLE = "it cannot be read"
    LINKED = "its folder is a link, and it is elsewhere"


@dataclass(frozen=True, slots=True)
class Retention:
    """The runs that ended before a time: those that may go, and those that stay, with the reason."""

    before: datetime
    leaving: tuple[PastRun, ...]
    kept: tuple[tuple[PastRun, KeptFor], ...]


def retention(cell: Cell, days: float, index: RunIndex | None = None) -> Retention:
    """What becomes of runs that ended more than ``days`` ago; nothing is deleted. Raises ``FileError``."""
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
    from hexacell.services.history.run_summary import is_applied_later  # noqa: PLC0415 - reads journals

    was = run.summary
    if run.folder.path.is_symlink():
        return KeptFor.LINKED
    if not was.mode:
        return KeptFor.UNREADABLE
    if run.is_in_controller or was.has_written or is_applied_later(run.folder):
        return KeptFor.APPLIED
    if not was.is_over:
        return KeptFor.RESUMABLE
    return KeptFor.PROPOSAL if was.has_proposal else None


def delete_runs(cell: Cell, runs: Sequence[PastRun]) -> None:
    """Delete the folders of runs, while nothing else uses the cell; raises ``CellBusy`` or ``FileError``.

    What has changed since the runs were listed is looked at again: one that must stay does.
    """
    with held_config(*cell.config_paths):
        now = {run.name: run for run in past_runs(cell)}
        for run in runs:
            present = now.get(run.name)
            if present is not None and reason_to_keep(present) is None:
                # In one step for all who list runs: half deleted it would be a damaged run.
                path = run.folder.path
                leaving = path.with_name(f"{LEAVING}{path.name}")
                with os_errors("cannot be deleted", path):
                    path.rename(leaving)
                _remove(leaving)
        for rest in runs_folder(cell).glob(f"{LEAVING}*"):
            _remove(rest)


def _remove(path: Path) -> None:
    with os_errors("cannot be deleted", path):
        path.unlink() if path.is_symlink() else shutil.rmtree(path)
