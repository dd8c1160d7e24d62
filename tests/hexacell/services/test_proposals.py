"""Proposals applied after their run: bit for bit, under the run's own gates, never over an edit."""

import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from hexacell import errors
from hexacell.cell.loader import load_cell
from hexacell.config.change import Receipt
from hexacell.config.layout import ConfigLayout
from hexacell.config.versions import ConfigEditedSince
from hexacell.config.write_record import NumberChange, later_approval
from hexacell.kinematics.corrections import Corrections
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.write_back.config_history import config_history
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.services.write_back.proposals import COMMAND, apply_proposal, read_proposal
from hexacell.storage import atomic_files
from hexacell.text.config_changes import applied_text, versions_text
from hexacell.text.screens.questions import question_view
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import Verdict
from procedures.engine.commands import UnattendedOperator
from procedures.run.questions import PendingChange, Question
from tests.hexacell.services.proposed_runs import GRAVE, MET, ProposedRun, propose_run

pytestmark = pytest.mark.usefixtures("records_agree")

DOUBTFUL = AcceptanceGate(
    name="agrees with the noise", passed=False, sentence="Doubtful: 1.4 times.", needs_person=True
)
HOPELESS = AcceptanceGate(name="converged", passed=False, sentence="It did not converge.")


class Person:
    """Answers with a name, or declines, and remembers the questions."""

    def __init__(self, name: str | None = "a tester") -> None:
        self.name = name
        self.asked: list[Question] = []

    async def ask(self, question: Question) -> str | None:
        self.asked.append(question)
        return self.name


async def apply(run: ProposedRun, person: Person | UnattendedOperator | None = None) -> str:
    return (await apply_proposal(read_proposal(run.folder), person or UnattendedOperator())).by


async def test_a_proposal_is_written_bit_for_bit_and_can_be_undone(cell) -> None:
    run = propose_run(cell)
    with cell_lock(cell.config_path), pytest.raises(errors.CellBusy):
        await apply(run)
    assert cell.config_path.read_bytes() == run.before
    assert await apply(run) == COMMAND
    assert cell.config_path.read_bytes() == run.after != run.before
    assert Receipt.of(run.folder.path).backup() == (run.before,)
    approval = later_approval(run.folder)
    assert approval is not None
    assert (approval.by, approval.sha256_after) == (COMMAND, run.change.sha256_after)
    before = cell.config_path.stat()
    assert await apply(run) == "", "what is there already is not written again"
    assert cell.config_path.stat().st_ino == before.st_ino


@pytest.mark.parametrize(("gate", "consent"), [(DOUBTFUL, "yes"), (GRAVE, "simulated-hexaglide")])
async def test_gates_need_the_person_that_they_needed_in_the_run(cell, gate, consent: str) -> None:
    run = propose_run(cell, gates=(MET, gate))
    with pytest.raises(errors.AnswerNeeded, match=gate.sentence) as refusal:
        await apply(run)
    assert refusal.value.exit_code is errors.ExitCode.ANSWER_NEEDED
    assert cell.config_path.read_bytes() == run.before
    person = Person()
    assert await apply(run, person) == "a tester"
    (question,) = person.asked
    assert question.consent == consent
    assert isinstance(question.subject, PendingChange)
    assert question.subject.diff == run.change.diff
    assert cell.config_path.read_bytes() == run.after


@pytest.mark.parametrize("verdict", [*(one for one in Verdict if one is not Verdict.PASS), None])
async def test_what_did_not_pass_needs_a_person(cell, verdict: Verdict | None) -> None:
    run = propose_run(cell, verdict=verdict)
    told = f"Its verification: 0.1 mm: {verdict.value}" if verdict else "No held-out record has verified it"
    with pytest.raises(errors.AnswerNeeded, match=told):
        await apply(run)
    await apply(run, Person())
    assert cell.config_path.read_bytes() == run.after


@pytest.mark.parametrize(
    ("gates", "verification"),
    [((HOPELESS,), {}), ((MET,), {"is_worse": True}), ((MET,), {"after_mm": None})],
)
async def test_what_nobody_may_accept_is_refused(cell, gates, verification) -> None:
    run = propose_run(cell, gates=gates, verdict=Verdict.FAIL, **verification)
    person = Person()
    with pytest.raises(errors.LimitError, match="the new geometry is refused") as refusal:
        await apply(run, person)
    assert refusal.value.exit_code is errors.ExitCode.OUT_OF_LIMITS
    assert person.asked == []
    assert cell.config_path.read_bytes() == run.before


async def test_who_declines_changes_nothing(cell) -> None:
    run = propose_run(cell, gates=(DOUBTFUL,))
    with pytest.raises(errors.LimitError, match="was declined; nothing was applied"):
        await apply(run, Person(None))
    assert cell.config_path.read_bytes() == run.before
    assert later_approval(run.folder) is None


async def test_an_edit_is_shown_number_by_number_and_kept(cell) -> None:
    run = propose_run(cell)
    text = run.before.decode()
    first = text.index("l = [") + len("l = [")
    edited = (text[:first] + "1234.5" + text[text.index(",", first) :]).encode()
    cell.config_path.write_bytes(edited)
    with pytest.raises(ConfigEditedSince, match="undo the edit") as refusal:
        await apply(run, Person())
    versions = refusal.value.versions
    assert len(versions.numbers) == 42
    touched = [one for one in versions.numbers if one.is_edited]
    assert [(one.name, one.now) for one in touched] == [("l1", 1234.5)]
    assert touched[0].written == pytest.approx(touched[0].before + 0.25)
    assert not versions.is_from_written
    assert "+l = [1234.5," in versions.edit
    assert cell.config_path.read_bytes() == edited
    assert not (run.folder.path / "write-back.json").exists()


CORRECTED = Corrections(
    backlash=(0.0, 0.0, 0.102, 0.0, 0.0, 0.0), compliance_um_n=(0.3,) * 6, weight_n=120.0
)


async def test_corrections_are_shown_written_recorded_and_undone_with_the_geometry(cell) -> None:
    run = propose_run(cell, gates=(DOUBTFUL,), shift_mm=0.01, corrections=CORRECTED)
    person, layout = Person(), ConfigLayout.of(cell.settings)
    applied = await apply_proposal(read_proposal(run.folder), person)
    (question,) = person.asked
    view = question_view(question, None)
    for text in (view.change, applied_text(applied)):
        assert "backlash of joint 3: 0 -> 0.102 mm\n" in text
        assert "weight: 0 -> 120 N\n" in text
    assert layout.read(cell.config_path).corrections == CORRECTED
    (write,) = config_history(cell).writes
    assert write.record.numbers_changed == 42 + 1 + 6 + 1
    assert write.record.largest == NumberChange(name="backlash of joint 3", change=0.102, unit="mm")
    roll_back_config(cell)
    assert cell.config_path.read_bytes() == run.before


async def test_an_edit_of_corrections_is_shown_and_kept(cell) -> None:
    run = propose_run(cell, corrections=CORRECTED)
    edited = run.before + b"\n[corrections]\nbacklash = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]\n"
    cell.config_path.write_bytes(edited)
    with pytest.raises(ConfigEditedSince) as refusal:
        await apply(run, Person())
    table = versions_text(refusal.value.versions)
    assert re.search(r"backlash of joint 3 +0\.000000 +0\.102000 +0\.200000  edited by hand", table)
    assert re.search(r"weight  +0\.000000 +120\.000000 +0\.000000\n", table)
    assert cell.config_path.read_bytes() == edited


async def test_corrections_that_are_not_those_of_the_journal_are_refused(cell) -> None:
    run = propose_run(cell, corrections=CORRECTED)
    other = propose_run(cell, "2026-11-20T110000Z", corrections=Corrections(backlash=(1.0,) * 6))
    run.folder.proposal.write_bytes(other.folder.proposal.read_bytes())
    with pytest.raises(errors.FileError, match="not the one of its journal"):
        await apply(run)


async def test_an_edit_that_is_no_config_is_shown_too(cell) -> None:
    run = propose_run(cell)
    cell.config_path.write_bytes(b"\xff not = a config")
    with pytest.raises(ConfigEditedSince) as refusal:
        await apply(run)
    numbers = refusal.value.versions.numbers
    assert {(one.now, one.is_edited) for one in numbers} == {(None, False)}


async def test_a_write_that_fails_is_undone_and_approved_by_nobody(cell, monkeypatch) -> None:
    run = propose_run(cell)
    written = atomic_files.write_atomically

    def garbled(path: Path, data: bytes, **options: Any) -> None:
        written(path, data + b"#" if data == run.after else data, **options)

    monkeypatch.setattr(atomic_files, "write_atomically", garbled)
    with pytest.raises(errors.WriteBackUndone) as failure:
        await apply(run)
    assert failure.value.exit_code is errors.ExitCode.WRITE_BACK_UNDONE
    assert cell.config_path.read_bytes() == run.before
    assert later_approval(run.folder) is None


async def test_a_proposal_of_another_run_or_behind_a_link_is_refused(cell, tmp_path) -> None:
    run, other = propose_run(cell), propose_run(cell, "2026-11-21T100000Z", shift_mm=0.5)
    run.folder.proposal.write_bytes(other.folder.proposal.read_bytes())
    elsewhere = tmp_path / "elsewhere"
    other.folder.proposal.rename(elsewhere)
    other.folder.proposal.symlink_to(elsewhere)
    for one in (run, other):
        with pytest.raises(errors.FileError, match="is not the one of its journal"):
            read_proposal(one.folder)


@pytest.mark.parametrize(
    ("edits", "is_same"),
    [
        ({"name = ": "# a note\nname = ", "simulated-hexaglide": "hall 3"}, True),
        ({"[identification]": '[report]\nplace = "hall 3"\n[identification]'}, True),
        *(({one: f"{one}1"}, False) for one in ("position_mm = ", "heartbeat_ms = ")),
    ],
)
def test_only_an_edit_on_which_the_result_depends_is_against_it(cell, edits, is_same) -> None:
    run, text = propose_run(cell), cell.text
    for old, new in edits.items():
        text = text.replace(old, new, 1)
    cell.path.write_text(text)
    runs = run.folder.siblings.rename(runs_folder(load_cell(cell.path)))
    with nullcontext() if is_same else pytest.raises(errors.UsageError, match="undo what has changed"):
        assert read_proposal(RunFolder(runs / run.folder.name)).change == run.change


def test_a_run_without_a_proposal_is_refused(cell, tmp_path) -> None:
    run = propose_run(cell)
    run.folder.proposal.unlink()
    with pytest.raises(errors.UsageError, match="proposed no change"):
        read_proposal(run.folder)
    with pytest.raises(errors.FileError, match="cannot be read"):
        read_proposal(RunFolder(tmp_path))
