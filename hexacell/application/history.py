"""The runs of a cell so far: verdicts, errors, results, and which of them the controller has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from hexacell.application.proposals import later_approval
from hexacell.cell.loader import Cell
from hexacell.controller_config.change import fingerprint
from hexacell.controller_config.write_back import RECEIPT, Receipt
from hexacell.decision import Verdict
from hexacell.errors import HexacellError, UsageError
from hexacell.reporting.result import IdentificationResult
from hexacell.reporting.run_comparison import ParameterTrend, RunComparison, compare_results, trends
from hexacell.reporting.verification import VerifiedAccuracy
from hexacell.runs.run_folder import RunFolder, find_run, runs_folder
from procedures.journal.journal import read_entries
from procedures.journal.line_format import Entry
from procedures.run import events
from procedures.run.state import RunState, fold


@dataclass(frozen=True, slots=True)
class PastRun:
    """One run of a cell.

    Attributes:
        began, ended: when its first and its last event were written, UTC.
        mode: check, optimise or length; empty where its journal cannot be read.
        verdict: none where there is none.
        accuracy: the errors at the task poses that the verdict is on; none where there is no such verdict.
        line: how it ended, in words; why its journal cannot be read, if it cannot.
        result: of its identification; none where there is none.
        is_over: whether it has ended; one that has not can be resumed.
        is_in_controller: whether the controller's config is the one that it wrote.
        has_written: whether it wrote the config at all, whatever was undone.
        has_proposal: whether it has a proposal that is not in the config, and can be applied.
    """

    folder: RunFolder
    began: datetime | None = None
    ended: datetime | None = None
    mode: str = ""
    records: int = 0
    verdict: Verdict | None = None
    accuracy: VerifiedAccuracy | None = None
    line: str = ""
    result: IdentificationResult | None = None
    is_over: bool = False
    is_in_controller: bool = False
    has_written: bool = False
    has_proposal: bool = False

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.path.name


def past_runs(cell: Cell) -> tuple[PastRun, ...]:
    """All runs of a cell, the newest first; those that cannot be read come last, with the reason.

    Raises:
        FileError: the controller's config cannot be read.
    """
    folder, config = runs_folder(cell), fingerprint(cell.config_path)
    paths = [path for path in folder.iterdir() if path.is_dir()] if folder.is_dir() else []
    runs = [past_run(RunFolder(path), config) for path in sorted(paths)]
    return tuple(sorted(runs, key=_age_rank, reverse=True))


def past_run(folder: RunFolder, config_sha256: str) -> PastRun:
    """One run; ``config_sha256`` is the fingerprint of the controller's config now."""
    try:
        entries = read_entries(folder.journal)
    except HexacellError as error:
        return PastRun(folder, line=str(error))
    if not entries:
        return PastRun(folder, line="its journal is empty")
    state = fold(entry.event for entry in entries)
    return PastRun(
        folder,
        began=entries[0].at,
        ended=entries[-1].at,
        mode="" if state.started is None else state.started.mode,
        records=sum(len(measured.samples) for measured in state.sets.values()),
        verdict=None if state.judged is None else state.judged.verdict,
        accuracy=_accuracy(state.judged),
        line=_last_line(entries, state),
        result=None if state.identified is None else state.identified.result,
        is_over=state.ended is not None,
        is_in_controller=_wrote_config(folder, config_sha256),
        has_written=(folder.path / RECEIPT).is_file(),
        has_proposal=_has_open_proposal(folder, state),
    )


def compare_runs(cell: Cell, before: str, after: str) -> tuple[PastRun, PastRun, RunComparison]:
    """Two runs, by folder or name, and what changed from one to the other.

    Raises:
        UsageError: there is no such run, it identified nothing, or their frames differ.
        FileError: the controller's config cannot be read.
    """
    config = fingerprint(cell.config_path)
    one, other = (past_run(find_run(cell, named), config) for named in (before, after))
    parameters = cell.settings.mechanism.parameters
    return one, other, compare_results(parameters, _result_of(one), _result_of(other))


def parameter_trends(cell: Cell, runs: Iterable[PastRun]) -> tuple[ParameterTrend, ...]:
    """The trend of each parameter over the runs whose identification converged, oldest first.

    Raises:
        UsageError: they have different frame conventions.
    """
    results = [
        (run.ended, run.result)
        for run in sorted(runs, key=_age_rank)
        if run.ended is not None and run.result is not None and run.result.converged
    ]
    return trends(cell.settings.mechanism.parameters, results)


def _result_of(run: PastRun) -> IdentificationResult:
    if run.result is None:
        raise UsageError(f"the run {run.name} identified no geometry", action="Name calibrations, which do")
    return run.result


def _age_rank(run: PastRun) -> tuple[bool, float, str]:
    return run.ended is not None, 0.0 if run.ended is None else run.ended.timestamp(), run.name


def _accuracy(judged: events.ResultValidated | None) -> VerifiedAccuracy | None:
    if judged is None:
        return None
    if judged.verification is not None:
        return judged.verification.accuracy
    return None if judged.check is None else judged.check.accuracy


def _last_line(entries: Sequence[Entry], state: RunState) -> str:
    if state.ended is not None:
        return state.ended.line
    last = entries[-1].event
    reason = last.reason if isinstance(last, events.Interrupted) else "it is going on, or was killed"
    return f"not over: {reason}"


def _has_open_proposal(folder: RunFolder, state: RunState) -> bool:
    """Whether what a run proposed was not written, or undone by the run itself."""
    is_in_use = state.committed is not None and not state.rolled_back
    is_applied = is_in_use or later_approval(folder) is not None
    return state.proposed is not None and folder.proposal.is_file() and not is_applied


def _wrote_config(folder: RunFolder, sha256: str) -> bool:
    try:
        return Receipt.of(folder.path).sha256_after == sha256
    except HexacellError:
        return False
