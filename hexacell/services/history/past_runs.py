"""The runs of a cell so far: verdicts, errors, results, and which of them the controller has.

What a run was is read from its folder once and kept in the cell's archive (:mod:`.run_index`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from hexacell.cell.fields import Frozen
from hexacell.cell.loader import Cell
from hexacell.config.layout import fingerprint
from hexacell.config.receipt import RECEIPT, Receipt
from hexacell.errors import HexacellError, UsageError
from hexacell.results.result import IdentificationResult
from hexacell.results.run_comparison import ParameterTrend, RunComparison, compare_results, trends
from hexacell.runs.archived_documents import DocumentKind
from hexacell.runs.run_folder import RunFolder, StartAttempts, find_run, read_attempts, runs_folder
from hexacell.services.history.run_index import RunIndex
from hexacell.services.write_back.proposals import later_approval
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import VerifiedAccuracy
from procedures.journal.journal import read_entries, read_journal
from procedures.journal.line_format import Entry
from procedures.run import events
from procedures.run.state import RunState, fold


class RunSummary(Frozen):
    """What a run was, by its folder alone: what the archive keeps of it.

    Attributes:
        began, ended: when its first and its last event were written, UTC.
        mode: check, quick, optimise or length; empty where its journal cannot be read.
        verdict: none where there is none.
        accuracy: the errors at the task poses that the verdict is on; none where there is no such verdict.
        line: how it ended, in words; why its journal cannot be read, if it cannot.
        has_result: whether it identified a geometry of its own, with which no other result took part.
        is_over: whether it has ended; one that has not can be resumed.
        written_sha256: fingerprint of the controller's config as it wrote it; none where it wrote none.
        has_written: whether it wrote the config at all, whatever was undone.
        has_proposal: whether it has a proposal that is not in the config, and can be applied.
        has_begun: whether it began at all; one that was refused each time did not.
    """

    began: datetime | None = None
    ended: datetime | None = None
    mode: str = ""
    records: int = 0
    verdict: Verdict | None = None
    accuracy: VerifiedAccuracy | None = None
    line: str = ""
    has_result: bool = False
    is_over: bool = False
    written_sha256: str | None = None
    has_written: bool = False
    has_proposal: bool = False
    has_begun: bool = True


@dataclass(frozen=True, slots=True)
class PastRun:
    """One run of a cell; ``is_in_controller``: whether the controller's config is the one that it wrote."""

    folder: RunFolder
    summary: RunSummary
    is_in_controller: bool = False

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.path.name


def past_runs(cell: Cell, index: RunIndex | None = None) -> tuple[PastRun, ...]:
    """All runs of a cell, the newest first; those that cannot be read come last, with the reason.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    config, folder = fingerprint(*cell.config_paths), runs_folder(cell)
    found = (index or RunIndex(cell)).documents(DocumentKind.SUMMARY, RunSummary, _summary)
    runs = [_past_run(RunFolder(folder / name), summary, config) for name, summary in found.items()]
    return tuple(sorted(runs, key=_age_rank, reverse=True))


def past_run(folder: RunFolder, config_sha256: str) -> PastRun:
    """One run; ``config_sha256`` is the fingerprint of the controller's config now."""
    return _past_run(folder, _summary(folder), config_sha256)


def _past_run(folder: RunFolder, summary: RunSummary, config_sha256: str) -> PastRun:
    return PastRun(folder, summary, summary.written_sha256 == config_sha256)


def _summary(folder: RunFolder) -> RunSummary:
    try:
        if not folder.journal.is_file() and (attempts := read_attempts(folder)) is not None:
            return _summary_of_attempts(attempts)
        entries = read_entries(folder.journal)
    except HexacellError as error:
        return RunSummary(line=str(error))
    if not entries:
        return RunSummary(line="its journal is empty")
    state = fold(entry.event for entry in entries)
    return RunSummary(
        began=entries[0].at,
        ended=entries[-1].at,
        mode="" if state.started is None else state.started.mode,
        records=sum(len(measured.samples) for measured in state.sets.values()),
        verdict=None if state.judged is None else state.judged.verdict,
        accuracy=judged_accuracy(state.judged),
        line=_last_line(entries, state),
        has_result=result_of_its_own(state) is not None,
        is_over=state.ended is not None,
        written_sha256=_written_sha256(folder),
        has_written=(folder.path / RECEIPT).is_file(),
        has_proposal=_has_open_proposal(folder, state),
    )


def _summary_of_attempts(refused: StartAttempts) -> RunSummary:
    """Of a run that never began."""
    first, last = refused.attempts[0].at, refused.last.at
    return RunSummary(
        began=first, ended=last, mode=refused.mode, line=refused.line, is_over=True, has_begun=False
    )


def compare_runs(cell: Cell, before: str, after: str) -> tuple[PastRun, PastRun, RunComparison]:
    """Two runs, by folder or name, and what changed from one to the other.

    Raises:
        UsageError: there is no such run, it identified nothing, or their frames differ.
        FileError: the controller's config cannot be read.
    """
    config = fingerprint(*cell.config_paths)
    one, other = (past_run(find_run(cell, named), config) for named in (before, after))
    results = (require_result(_state_of(run.folder), run.name) for run in (one, other))
    return one, other, compare_results(cell.settings.mechanism.parameters, *results)


def parameter_trends(
    cell: Cell, runs: Iterable[PastRun], index: RunIndex | None = None
) -> tuple[ParameterTrend, ...]:
    """The trend of each parameter over the runs whose identification converged, oldest first.

    Raises:
        UsageError: they have different frame conventions.
    """
    identified = [run for run in sorted(runs, key=_age_rank) if run.summary.has_result]
    found = (index or RunIndex(cell)).documents(
        DocumentKind.RESULT, IdentificationResult, _result, [run.name for run in identified]
    )
    results = [
        (run.summary.ended, found[run.name])
        for run in identified
        if run.summary.ended is not None and run.name in found and found[run.name].converged
    ]
    return trends(cell.settings.mechanism.parameters, results)


def is_applied_later(folder: RunFolder) -> bool:
    """Whether a run's proposal was applied after it; also where the note of that is damaged."""
    try:
        return later_approval(folder) is not None
    except HexacellError:
        return True


def _result(folder: RunFolder) -> IdentificationResult | None:
    return result_of_its_own(_state_of(folder))


def _state_of(folder: RunFolder) -> RunState:
    """The state of a run as far as it got; empty where its journal cannot be read."""
    try:
        return fold(read_journal(folder.journal))
    except HexacellError:
        return RunState()


def _age_rank(run: PastRun) -> tuple[bool, float, str]:
    ended = run.summary.ended
    return ended is not None, 0.0 if ended is None else ended.timestamp(), run.name


def result_of_its_own(state: RunState) -> IdentificationResult | None:
    """What its records alone identified; none where nothing was identified, and none of the quick level.

    That of the quick level has the errors of the result that it started from: the two are no two witnesses.
    """
    is_quick = state.started is not None and state.started.mode == "quick"
    return None if state.identified is None or is_quick else state.identified.result


def require_result(state: RunState, run: str) -> IdentificationResult:
    """What the records of a run alone identified; raises ``UsageError`` where there is no such result."""
    result = result_of_its_own(state)
    if result is None:
        raise UsageError(
            f"the run {run} identified no geometry of its own", action="Name calibrations, which do"
        )
    return result


def judged_accuracy(judged: events.ResultValidated | None) -> VerifiedAccuracy | None:
    """The errors at the task poses that a verdict is on; none where there is no such verdict."""
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
    is_applied = is_in_use or is_applied_later(folder)
    return state.proposed is not None and folder.proposal.is_file() and not is_applied


def _written_sha256(folder: RunFolder) -> str | None:
    try:
        return Receipt.of(folder.path).sha256_after
    except HexacellError:
        return None
