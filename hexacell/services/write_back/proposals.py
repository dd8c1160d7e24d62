"""The proposal of a run, written into the controller's config afterwards by a person.

A run folder may come from elsewhere. So the config is that of the cell beside it, and what the folder
says of gates, geometry and text is computed again from the records before anything is written.
"""

from contextlib import suppress
from dataclasses import dataclass

from hexacell.cell.loader import Cell, is_cell_file, load_cell
from hexacell.config import write_record
from hexacell.config.change import ConfigChange
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout, are_same_files, fingerprint
from hexacell.config.pending_write import held_config
from hexacell.config.versions import ConfigEditedSince, compare_versions
from hexacell.config.write_back import commit
from hexacell.errors import FileError, HexacellError, LimitError, UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.history.journal_soundness import require_sound
from hexacell.services.history.recorded_cell import has_same_cell
from hexacell.services.history.resumption import require_own_run
from hexacell.services.run.replay_run import replay
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.journal.journal import RESTORE, now, read_entries, read_journal
from procedures.replay.replayer import Scope, is_outcome
from procedures.resources.controller_config import holds_provisional
from procedures.run.questions import Operator, Question, ask_approval
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.commit import pending_change

COMMAND = "the command"
"""Who approves what needs no person: who typed ``apply``."""

COMPUTED = (events.NoiseMeasured, events.Identified, events.Proposed, events.ResultValidated)
"""Events on which a proposal and its gates stand; a step computes each of them from the records."""

SAME = 1e-6
"""Largest difference of a number computed again: another computer may round otherwise."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """The change of the config that a run proposed, and the conditions under which it may be written."""

    folder: RunFolder
    cell: str
    change: ConfigChange
    gates: tuple[AcceptanceGate, ...]
    layout: ConfigLayout
    parameters: ParameterSet
    state: RunState

    @property
    def displacement(self) -> TaskDisplacement | None:
        """How far it moves taught points and frames; None if that is not known."""
        return None if self.state.proposed is None else self.state.proposed.displacement


@dataclass(frozen=True, slots=True)
class AppliedProposal:
    """A proposal that the config has now.

    ``by`` is who had it written, empty if it was there already; ``unrecorded`` why the history has no
    record of it, in a sentence, empty if it has.
    """

    proposal: Proposal
    by: str
    unrecorded: str = ""


def read_proposal(folder: RunFolder) -> Proposal:
    """The proposal of a run of the cell beside it.

    Raises:
        UsageError: it proposed nothing, or is not of that cell.
        FileError: its files do not fit together.
    """
    history = read_journal(folder.journal)
    state = fold(history)
    started = state.started
    if started is None or state.proposed is None or not folder.proposal.exists():
        raise UsageError(
            "this run proposed no change of a config",
            subject=folder.path,
            action="Name a calibration that identified a geometry",
        )
    cell = _own_cell(folder, started)
    require_sound(history, cell.settings, folder.journal, follows_plan=False)
    change = ConfigChange.load(folder.proposal)
    _require_together(folder, started, state.proposed, change)
    require_own_run(cell, folder, state, is_resumed=False)
    return Proposal(
        folder,
        started.cell,
        change.to_files(cell.config_paths),
        (*state.proposed.gates, _verification_gate(state)),
        ConfigLayout.of(cell.settings),
        cell.settings.mechanism.parameters,
        state,
    )


def _own_cell(folder: RunFolder, started: events.RunStarted) -> Cell:
    """The cell that made a run folder: its file beside ``runs`` has all that the result depends on."""
    for path in filter(is_cell_file, sorted(folder.siblings.parent.parent.glob("*.toml"))):
        with suppress(HexacellError):
            cell = load_cell(path)
            if runs_folder(cell).resolve() == folder.siblings.resolve() and has_same_cell(started, cell):
                return cell
    raise UsageError(
        "the cell file that this run began with is not beside it",
        subject=folder.path,
        action="Name the folder in `runs` beside the cell file, and undo what has changed in that since",
    )


async def require_as_recorded(proposal: Proposal) -> None:
    """Compute the proposal and what its gates stand on again from the records of the run.

    Raises:
        FileError: the records give something else than the folder says.
    """
    found = await replay(proposal.folder.path, Scope.RESULTS, SAME)
    wrong = [one.line for one in found.differences if found.counts(one)]
    step = None
    for entry in read_entries(proposal.folder.journal):
        if isinstance(entry.event, events.StepBegun):
            step = entry.event.step
        elif isinstance(entry.event, COMPUTED) and (step is None or not is_outcome(step, entry.event)):
            wrong.append(entry.number)
    if wrong or found.change is None or found.change.after_contents != proposal.change.after_contents:
        raise FileError(
            "the records of the run give another proposal",
            subject=proposal.folder.journal,
            line=min(wrong, default=None),
            action="Calibrate again; `hexacell replay RUN` shows what differs",
        )


def approval_question(proposal: Proposal) -> Question:
    """What a person is asked before it is written, with the gates that may refuse it."""
    return ask_approval(pending_change(proposal.state, proposal.change, proposal.gates), cell=proposal.cell)


async def apply_proposal(
    proposal: Proposal, operator: Operator | None, *, typed_by: str = COMMAND, reason: str = ""
) -> AppliedProposal:
    """Write a proposal into the controller's config, once a person has accepted what needs one.

    The ``operator`` is asked where a gate needs a person; without one ``typed_by`` has accepted it already.
    ``reason`` is why, as the history of the config is to have it.

    Raises:
        UsageError: ``reason`` is no line of text.
        LimitError: a gate refuses it, or the person declined.
        AnswerNeeded: a person must accept it, and nobody is there.
        ConfigEditedSince: the config was edited since the run began.
        FileError: the records do not give it.
        CellBusy, FileError, WriteBackUndone: see :func:`~hexacell.config.write_back.commit`.
    """
    change, reason = proposal.change, write_record.stated_reason(reason)
    with held_config(*change.paths):
        if fingerprint(*change.paths) == change.sha256_after:
            return AppliedProposal(proposal, "")
        _require_unedited(proposal)
        await require_as_recorded(proposal)
        by = await _approval(proposal, operator, typed_by)
        approval = write_record.LaterApproval(by=by, at=now()[0], sha256_after=change.sha256_after)
        approval.save(write_record.approval_path(proposal.folder), like=change.path)
        judged = proposal.state.judged
        outcome = "not verified by its run" if judged is None else judged.line
        cause = write_record.WriteCause(
            write_record.WriteKind.APPLIED, by, proposal.folder.name, outcome, reason
        )
        folder, layout = proposal.folder.siblings, proposal.layout
        try:
            with write_record.recorded_write(folder, change.paths, layout, cause) as recording:
                commit(change, proposal.folder.path)
        except BaseException:
            write_record.approval_path(proposal.folder).unlink(missing_ok=True)
            raise
    return AppliedProposal(proposal, by, recording.problem)


async def _approval(proposal: Proposal, operator: Operator | None, typed_by: str) -> str:
    failed = [gate for gate in proposal.gates if not gate.passed]
    if refused := [gate.sentence for gate in failed if not gate.needs_person]:
        raise LimitError("the new geometry is refused: " + " ".join(refused))
    if not failed or operator is None:
        return typed_by
    if (name := await operator.ask(approval_question(proposal))) is None:
        raise LimitError("the new geometry was declined; nothing was applied")
    return name


def _verification_gate(state: RunState) -> AcceptanceGate:
    judged = state.judged
    if judged is None or judged.verification is None:
        sentence = "No held-out record has verified it."
        return AcceptanceGate(name="verified", passed=False, sentence=sentence, needs_person=True)
    return AcceptanceGate(
        name="verified",
        passed=judged.verification.is_kept,
        sentence=f"Its verification: {judged.line}.",
        needs_person=judged.verification.is_offered,
    )


def _require_unedited(proposal: Proposal) -> None:
    change = proposal.change
    if fingerprint(*change.paths) == change.sha256_before:
        return
    if holds_provisional(proposal.folder, change.paths):
        problem = "the run was interrupted and left its provisional geometry here"
        raise UsageError(problem, subject=change.path, action="Resume that run, which takes it back")
    stated = (change.before, change.corrections_before), (change.after, change.corrections_after)
    before, after = (
        ControllerGeometry(Geometry.of(proposal.parameters, geometry), (), corrections=corrections)
        for geometry, corrections in stated
    )
    versions = compare_versions(
        change.paths, proposal.layout, (before, change.before_contents), (after, change.after_contents)
    )
    raise ConfigEditedSince(
        "the config changed since the run began; its geometry does not belong to it",
        versions,
        path=change.path,
        action="Nothing was written: undo the edit and repeat, or calibrate again",
    )


def _require_together(
    folder: RunFolder, started: events.RunStarted, proposed: events.Proposed, change: ConfigChange
) -> None:
    """The proposal is the one of the journal, and for the config that the run began with."""
    is_same_config = are_same_files(change.paths, started.config_paths)
    is_same_text = change.sha256_before == started.config_sha256
    if (
        folder.proposal.is_symlink()
        or not (is_same_config and is_same_text)
        or proposed.written != change.after
        or proposed.corrections not in {None, change.corrections_after}
    ):
        raise FileError(
            "this proposal is not the one of its journal", subject=folder.proposal, action=RESTORE
        )
