"""What a run is worth telling for, and what is told of it."""

import pytest

from hexacell.cell.loader import Cell
from hexacell.cell.operation import Occasion
from hexacell.errors import AnswerNeeded, CellBusy, DeviceError, SeveralErrors
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.past_runs import past_runs
from hexacell.services.run.calibration_run import RunRequest
from hexacell.services.unattended import notice as run_notices
from hexacell.services.unattended.notice import RunEnd, notice_of_end, notice_of_failure
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.hexacell.services.proposed_runs import propose_run


def request(cell: Cell, folder: RunFolder) -> RunRequest:
    return RunRequest(cell, folder, Mode.OPTIMISE, UnattendedOperator(), unattended=True)


def end(cell: Cell, verdict: Verdict | None, code: int) -> RunEnd:
    folder = propose_run(cell, verdict=verdict).folder
    ended = events.Ended(exit_code=code, line="over")
    return RunEnd(request(cell, folder), ended, fold(read_journal(folder.journal)))


@pytest.mark.parametrize(
    ("verdict", "code", "occasions"),
    [
        (Verdict.PASS, 0, ["pass"]),
        (Verdict.PASS, 4, ["answer-needed"]),
        (Verdict.FAIL, 1, ["no-pass"]),
        (Verdict.CONDITIONAL_PASS, 4, ["no-pass", "answer-needed"]),
        (Verdict.NOT_EVALUATED, 1, ["no-pass"]),
        (None, 1, ["failure"]),
    ],
)
def test_what_it_is_worth_telling_for(cell, verdict, code, occasions) -> None:
    notice = notice_of_end(end(cell, verdict, code))
    assert list(notice.occasions) == occasions
    assert (notice.verdict, notice.exit_code) == (verdict, code)
    assert notice.line == f"{cell.settings.name}: over"
    assert notice.title.endswith(", ".join(occasions))


def test_the_same_end_has_the_same_id_and_another_another(cell) -> None:
    passed = end(cell, Verdict.PASS, 0)
    ids = [notice_of_end(passed).id, notice_of_end(passed).id]
    journal = passed.request.folder.journal
    judged = RunEnd(passed.request, events.Ended(exit_code=4, line="over"), fold(read_journal(journal)))
    assert ids[0] == ids[1] != notice_of_end(judged).id


@pytest.mark.parametrize(
    ("error", "code", "occasion"),
    [
        (CellBusy("in use"), 5, Occasion.FAILURE),
        (AnswerNeeded("somebody must approve"), 4, Occasion.ANSWER_NEEDED),
        (SeveralErrors("two things", [DeviceError("one"), DeviceError("two")]), 3, Occasion.FAILURE),
        (ValueError("hidden"), 70, Occasion.FAILURE),
    ],
)
def test_a_run_that_did_not_come_to_its_end(cell, error, code, occasion) -> None:
    notice = notice_of_failure(request(cell, RunFolder(cell.path.parent / "runs" / "x")), error)
    assert (notice.exit_code, notice.occasions, notice.run) == (code, (occasion,), None)
    assert "\n" not in notice.line
    assert "hidden" not in notice.line


def test_when_the_next_calibration_is_due_is_told(cell, monkeypatch) -> None:
    acceptance = cell.settings.acceptance.model_copy(update={"valid_days": 30.0})
    settings = cell.settings.model_copy(update={"acceptance": acceptance})
    dated = Cell(cell.path, settings, cell.document)
    ended = end(dated, Verdict.PASS, 0)
    assert notice_of_end(ended).due_at is None, "it wrote nothing"
    (run,) = past_runs(dated)
    in_force = type(run)(run.folder, run.summary, is_in_controller=True)
    monkeypatch.setattr(run_notices, "past_runs", lambda _: (in_force,))
    due = notice_of_end(ended).due_at
    assert due is not None
    assert run.summary.ended is not None
    assert (due - run.summary.ended).days == 30
