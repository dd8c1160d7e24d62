"""The history of a cell's config: each way of writing it leaves a record, which outlives its run."""

import os
import shutil
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import Mock

import pytest

from hexacell.cell.loader import Cell
from hexacell.config import write_record
from hexacell.config.layout import ConfigLayout
from hexacell.config.write_back import commit
from hexacell.config.write_record import RECORDS, THE_RUN, WriteCause, WriteKind, recorded_write
from hexacell.errors import UsageError
from hexacell.runs.cell_lock import user_name
from hexacell.runs.run_folder import runs_folder
from hexacell.services.write_back.config_history import config_history
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.services.write_back.proposals import COMMAND, apply_proposal, read_proposal
from hexacell.verdict.decision import Verdict
from procedures.engine.commands import UnattendedOperator
from procedures.journal import journal as journals
from procedures.steps import events
from tests.hexacell.services.proposed_runs import ProposedRun, propose_run
from tests.recorded_events import record

pytestmark = pytest.mark.usefixtures("records_agree")


@pytest.fixture
def records(cell) -> Path:
    return runs_folder(cell) / RECORDS


async def apply(run: ProposedRun, reason: str = "") -> str:
    applied = await apply_proposal(read_proposal(run.folder), UnattendedOperator(), reason=reason)
    return applied.unrecorded


def kinds(cell: Cell) -> list[WriteKind]:
    return [one.record.kind for one in config_history(cell).writes]


async def test_applied_and_rolled_back_by_hand(cell) -> None:
    run = propose_run(cell)
    assert await apply(run, "  the fixture was exchanged ") == ""
    assert await apply(run, "what writes nothing leaves no record") == ""
    assert roll_back_config(cell, reason="it hums").unrecorded == ""
    back, applied = config_history(cell).writes
    assert (applied.record.kind, applied.record.run) == (WriteKind.APPLIED, run.folder.path.name)
    assert (applied.record.by, applied.record.reason) == (COMMAND, "the fixture was exchanged")
    assert (applied.record.why, applied.verdict) == ("0.1 mm: pass", Verdict.PASS)
    assert (applied.record.user, applied.record.host) == (user_name(), os.uname().nodename)
    assert applied.record.files == (cell.config_path.absolute(),)
    assert (back.record.kind, back.record.reason) == (WriteKind.ROLLED_BACK, "it hums")
    assert back.record.why == f"by hand, as it was before {run.folder.path.name}"
    assert back.record.numbers_changed == applied.record.numbers_changed == 42
    for one, change in ((applied, 0.25), (back, -0.25)):
        assert one.record.largest is not None
        assert one.record.largest.change == pytest.approx(change)
        assert one.record.largest.unit == "mm"
    assert (applied.record.sha256_before, applied.record.sha256_after) == (
        run.change.sha256_before,
        run.change.sha256_after,
    )
    assert back.record.sha256_after == run.change.sha256_before
    assert back.verdict is None
    shutil.rmtree(run.folder.path)
    _, left = config_history(cell).writes
    assert (left.record, left.is_recorded, left.verdict) == (applied.record, True, None)


async def test_a_reason_of_several_lines_is_refused_before_anything_is_written(cell) -> None:
    run = propose_run(cell)
    with pytest.raises(UsageError, match="one line"):
        await apply(run, "one\ntwo")
    assert cell.config_path.read_bytes() == run.before
    await apply(run)
    with pytest.raises(UsageError, match="one line"):
        roll_back_config(cell, reason="x" * 1001)
    assert cell.config_path.read_bytes() == run.after


async def test_a_torn_last_line_costs_no_other(cell, records) -> None:
    run = propose_run(cell)
    await apply(run)
    roll_back_config(cell)
    whole = records.read_bytes()
    records.write_bytes(whole[:-20])
    found = config_history(cell)
    assert ([one.record.kind for one in found.writes], found.damaged) == ([WriteKind.APPLIED], (2,))
    roll_back_config(cell, run.folder.path.name)
    with records.open("ab") as stream:
        stream.write(b'{"version": 2, "novelty": 1}\n')  # of a newer program
    found = config_history(cell)
    assert [one.record.kind for one in found.writes] == [WriteKind.ROLLED_BACK, WriteKind.APPLIED]
    assert found.damaged == (2, 4)


@pytest.mark.parametrize("obstacle", ["a folder", "a full disk", "a link"])
async def test_a_write_that_cannot_be_recorded_stays_and_is_told(
    cell, records, tmp_path, monkeypatch, obstacle: str
) -> None:
    run = propose_run(cell)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_bytes(b"precious")
    if obstacle == "a folder":
        records.mkdir(parents=True)
    elif obstacle == "a link":
        records.symlink_to(elsewhere)
    else:
        monkeypatch.setattr("hexacell.config.write_record.os.write", Mock(side_effect=OSError(28, "full")))
    told = [await apply(run)]
    assert cell.config_path.read_bytes() == run.after
    told.append(roll_back_config(cell).unrecorded)
    for one in told:
        assert one.startswith("The config is written, but the history has no record of it: ")
        assert RECORDS in one
    assert (cell.config_path.read_bytes(), elsewhere.read_bytes()) == (run.before, b"precious")
    if obstacle == "a full disk":
        assert records.read_bytes() == b"", "no part of a record"
    if obstacle == "a folder":
        records.rmdir()
        (known,) = config_history(cell).writes
        assert (known.record.kind, known.record.by) == (WriteKind.APPLIED, COMMAND)
        assert not known.is_recorded


def test_a_provisional_geometry_has_no_verdict(cell) -> None:
    run = propose_run(cell)
    cause = WriteCause(WriteKind.PROVISIONAL, THE_RUN, run.folder.name, "to measure on")
    with recorded_write(run.folder.siblings, cell.config_paths, ConfigLayout.of(cell.settings), cause):
        commit(run.change, run.folder.path)
    (written,) = config_history(cell).writes
    assert (written.record.kind, written.verdict, written.why) == (
        WriteKind.PROVISIONAL,
        None,
        "to measure on",
    )


def test_folders_of_before_are_told_by_their_journals(cell) -> None:
    run = propose_run(cell, verdict=None)
    commit(run.change, run.folder.path)
    record(run.folder.journal, [events.Committed(approved_by="a tester")])
    cell.config_path.write_bytes(run.before)
    judged = events.ResultValidated(verdict=Verdict.FAIL, line="0.3 mm: fail (worse than before)")
    record(run.folder.journal, [judged, events.RolledBack()])
    back, written = config_history(cell).writes
    assert (written.record.kind, written.record.by) == (WriteKind.RESULT, "a tester")
    assert (written.is_recorded, written.verdict, written.record.user) == (False, Verdict.FAIL, "")
    assert written.record.sha256_after == run.change.sha256_after == back.record.sha256_before
    assert (back.record.kind, back.record.why) == (WriteKind.TAKEN_BACK, "0.3 mm: fail (worse than before)")


def test_writes_within_a_millisecond_stay_in_their_order_and_are_told_once(cell, monkeypatch) -> None:
    """Journals have milliseconds, records of writes microseconds: a fast computer does all that in one."""
    run = propose_run(cell, verdict=None)
    at = datetime(2026, 11, 20, 10, 5, tzinfo=UTC)
    record_time = Mock(now=lambda zone: at.replace(microsecond=900))
    monkeypatch.setattr(write_record, "datetime", record_time)
    monkeypatch.setattr(journals, "now", lambda: (at.replace(microsecond=999), 1.0))
    cause = WriteCause(WriteKind.RESULT, "a tester", run.folder.name, "")
    with recorded_write(run.folder.siblings, cell.config_paths, ConfigLayout.of(cell.settings), cause):
        commit(run.change, run.folder.path)
    judged = events.ResultValidated(verdict=Verdict.FAIL, line="0.3 mm: fail (worse than before)")
    record(run.folder.journal, [events.Committed(approved_by="a tester"), judged, events.RolledBack()])
    assert kinds(cell) == [WriteKind.TAKEN_BACK, WriteKind.RESULT]
