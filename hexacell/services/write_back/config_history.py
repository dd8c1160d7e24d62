"""All writes into a cell's config, the newest first: who, when, what and why.

They are recorded beside the run folders. Where a record could not be written, as on a full disk, the run's
own folder has when it was, who approved it and why: in its journal, and ``applied.json``.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.config.change import Receipt
from hexacell.config.write_record import (
    RECORDS,
    THE_RUN,
    WriteKind,
    WriteRecord,
    later_approval,
    read_records,
)
from hexacell.errors import HexacellError
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.write_back.config_rollback import receipts_of
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_entries
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.roll_back import reason_to_take_back

_OF_THE_RESULT = (WriteKind.RESULT, WriteKind.APPLIED, WriteKind.TAKEN_BACK)
"""Writes that the verdict of the run is about."""


@dataclass(frozen=True, slots=True)
class ConfigWrite:
    """One write into the config of a cell.

    Attributes:
        record: what is known of it.
        is_recorded: whether a record was kept; else it is known from the run's folder.
        verdict: the verdict of its run, if any.
        line: the outcome in words; empty where there is no verdict.
    """

    record: WriteRecord
    is_recorded: bool
    verdict: Verdict | None = None
    line: str = ""

    @property
    def why(self) -> str:
        """The cause; of a result its outcome, which came after it was written; empty if it is not known."""
        return self.line if self.record.kind is WriteKind.RESULT else self.record.why or self.line


@dataclass(frozen=True, slots=True)
class ConfigHistory:
    """The writes into a cell's config, the newest first.

    ``damaged`` are the lines of ``path``, the file of the records, that cannot be read; they are left out.
    """

    writes: tuple[ConfigWrite, ...]
    path: Path
    damaged: tuple[int, ...]


def config_history(cell: Cell) -> ConfigHistory:
    """Every write into the config of a cell that its runs know of; raises ``FileError``."""
    folder = runs_folder(cell)
    records, damaged = read_records(folder)
    runs: dict[str, tuple[RunState, list[WriteRecord]]] = {}
    for receipt in receipts_of(cell):
        run = RunFolder(receipt.backup_folder)
        with suppress(HexacellError):  # runs that cannot be read are left out
            runs[run.name] = _read(run, receipt)
    found: list[ConfigWrite] = []
    for name in sorted({*runs, *(record.run for record in records)}):
        state, noted = runs.get(name, (RunState(), []))  # nothing is known of one that is deleted
        own = [record for record in records if record.run == name]
        line = state.judged.line if state.judged else ""
        every = [*((one, True) for one in own), *((one, False) for one in _unrecorded(noted, own))]
        for record, is_recorded in every:
            verdict = (state.verdict, line) if record.kind in _OF_THE_RESULT else (None, "")
            found.append(ConfigWrite(record, is_recorded, *verdict))
    # Reversed only when sorted: of two in the same millisecond the later one stays the newer.
    oldest_first = sorted(found, key=lambda one: _in_milliseconds(one.record.at))
    return ConfigHistory(tuple(reversed(oldest_first)), folder / RECORDS, damaged)


def _unrecorded(noted: Sequence[WriteRecord], records: Sequence[WriteRecord]) -> list[WriteRecord]:
    """The noted writes without a record, in their order; each record is of the first that it fits."""
    left = list(noted)
    for record in records:
        fitting = (index for index, one in enumerate(left) if _is_of(record, one))
        if (match := next(fitting, None)) is not None:
            del left[match]
    return left


def _is_of(record: WriteRecord, noted: WriteRecord) -> bool:
    """A record is kept between the write and the line of the journal. ``applied.json`` is before both.

    Journals have milliseconds, so that what came after it may seem to have come before.
    """
    recorded_at, noted_at = _in_milliseconds(record.at), _in_milliseconds(noted.at)
    in_order = noted_at <= recorded_at if record.kind is WriteKind.APPLIED else recorded_at <= noted_at
    return record.kind is noted.kind and in_order


def _in_milliseconds(at: datetime) -> datetime:
    return at.replace(microsecond=at.microsecond // 1000 * 1000)


def _read(run: RunFolder, receipt: Receipt) -> tuple[RunState, list[WriteRecord]]:
    """The state of a run, and what its folder says of its writes."""
    state, noted = RunState(), list[WriteRecord]()
    for entry in read_entries(run.journal):
        match entry.event:
            case events.Committed(approved_by=by):
                noted.append(_record(WriteKind.RESULT, entry.at, by, run, receipt))
            case events.RolledBack() if state.committed is not None:
                why = reason_to_take_back(state)
                noted.append(_record(WriteKind.TAKEN_BACK, entry.at, THE_RUN, run, receipt, why))
        state = apply(state, entry.event)
    if (approval := later_approval(run)) is not None:
        noted.append(_record(WriteKind.APPLIED, approval.at, approval.by, run, receipt))
    return state, noted


def _record(
    kind: WriteKind, at: datetime, by: str, run: RunFolder, receipt: Receipt, why: str = ""
) -> WriteRecord:
    before, after = receipt.sha256_before, receipt.sha256_after
    if kind is WriteKind.TAKEN_BACK:
        before, after = after, before
    return WriteRecord(
        at=at,
        kind=kind,
        by=by,
        run=run.name,
        files=receipt.paths,
        sha256_before=before,
        sha256_after=after,
        why=why,
    )
