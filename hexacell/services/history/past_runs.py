"""The runs of a cell so far: all of them, two compared, and the trends of their parameters.

What a run was is read from its folder once and kept in the cell's archive (:mod:`.run_index`); what reads
journals is imported only where a run is not in the archive yet.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from hexacell.cell.loader import Cell
from hexacell.config.layout import fingerprint
from hexacell.runs.archived_documents import DocumentKind
from hexacell.runs.run_folder import RunFolder, find_run, runs_folder
from hexacell.services.history.run_index import PastRun, RunIndex, RunSummary

if TYPE_CHECKING:
    from hexacell.results.run_comparison import ParameterTrend, RunComparison


def past_runs(cell: Cell, index: RunIndex | None = None) -> tuple[PastRun, ...]:
    """All runs of a cell, the newest first; those that cannot be read come last, with the reason.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    config, folder = fingerprint(*cell.config_paths), runs_folder(cell)
    found = (index or RunIndex(cell)).documents(DocumentKind.SUMMARY, RunSummary, _summary)
    runs = [_past_run(RunFolder(folder / name), summary, config) for name, summary in found.items()]
    return tuple(sorted(runs, key=_age_rank, reverse=True))


def _past_run(folder: RunFolder, summary: RunSummary, config_sha256: str) -> PastRun:
    return PastRun(folder, summary, summary.written_sha256 == config_sha256)


def _summary(folder: RunFolder) -> RunSummary:
    from hexacell.services.history.run_summary import run_summary  # noqa: PLC0415 - only what is not kept yet

    return run_summary(folder)


def compare_runs(cell: Cell, before: str, after: str) -> tuple[PastRun, PastRun, RunComparison]:
    """Two runs, by folder or name, and what changed from one to the other.

    Raises:
        UsageError: there is no such run, it identified nothing, or their frames differ.
        FileError: the controller's config cannot be read.
    """
    from hexacell.results.run_comparison import compare_results  # noqa: PLC0415 - only where runs are compared
    from hexacell.services.history.run_summary import require_result, run_summary, state_of  # noqa: PLC0415

    config = fingerprint(*cell.config_paths)
    folders = (find_run(cell, named) for named in (before, after))
    one, other = (_past_run(folder, run_summary(folder), config) for folder in folders)
    results = (require_result(state_of(run.folder), run.name) for run in (one, other))
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
