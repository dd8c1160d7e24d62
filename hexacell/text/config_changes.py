"""Text for changes of the controller's config outside a run: applied, rolled back, or edited by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hexacell.config.change import BEFORE, kept_paths
from hexacell.config.layout import names_of
from hexacell.config.versions import ConfigVersions
from hexacell.config.write_record import WriteKind, WriteRecord
from hexacell.text.layout import counted, wrapped

if TYPE_CHECKING:
    from hexacell.kinematics.corrections import CorrectionChange
    from hexacell.services.write_back.config_history import ConfigWrite
    from hexacell.services.write_back.config_rollback import ConfigRollback
    from hexacell.services.write_back.proposals import AppliedProposal
    from procedures.run.questions import PendingChange

RELOAD = "Restart or reload the controller before it moves: until then it uses what it read before."


def applied_text(applied: AppliedProposal) -> str:
    """What an application of a proposal did, and what is to be done next."""
    from hexacell.text.verdict import teaching_line  # noqa: PLC0415 - only where something was applied

    proposal = applied.proposal
    if not applied.by:
        files = files_named(proposal.change.paths, "has", "have")
        return f"{files} this geometry already; nothing was written."
    kept = kept_paths(proposal.folder.path, BEFORE, len(proposal.change.paths))
    teaching = () if proposal.displacement is None else (teaching_line(proposal.displacement),)
    return "\n".join(
        (
            f"Written into {files_named(proposal.change.paths)}, approved by {applied.by}.",
            *correction_lines(proposal.change.changed_corrections),
            *teaching,
            wrapped(RELOAD),
            f"`hexacell rollback` undoes it; the old config is {files_named(kept)}.",
            *filter(None, [wrapped(applied.unrecorded)]),
        )
    )


def correction_lines(changes: Sequence[CorrectionChange]) -> tuple[str, ...]:
    """What changes beside the geometry, a line each: "backlash of joint 3: 0 -> 0.102 mm"."""
    return tuple(f"{one.name}: {one.before:.6g} -> {one.after:.6g} {one.unit}".rstrip() for one in changes)


def pending_text(pending: PendingChange) -> str:
    """A change that waits for a person: what changes beside the geometry, and the text change."""
    return "\n".join([*correction_lines(pending.corrections), pending.diff.rstrip()])


def rollback_text(done: ConfigRollback) -> str:
    """What a rollback did, and what is to be done next."""
    if not done.change:
        files = files_named(done.paths, "is", "are")
        return f"{files} as in {files_named(done.restored)} already; nothing was written."
    undone = "" if done.undone is None else f", which undoes the run {done.undone.name}"
    copies = zip(done.paths, done.restored, strict=True)
    back = ",\n".join(f"{path} is {copy} again" for path, copy in copies)
    lines = (done.change, f"{back}, bit for bit{undone}.", wrapped(RELOAD), wrapped(done.unrecorded))
    return "\n".join(filter(None, lines))


NO_WRITES = "No run of this cell wrote its config."

_WRITES = {
    WriteKind.RESULT: "the result of {run} written",
    WriteKind.APPLIED: "the proposal of {run} applied",
    WriteKind.ROLLED_BACK: "rolled back",
    WriteKind.TAKEN_BACK: "the result of {run} undone by the run itself",
    WriteKind.PROVISIONAL: "a provisional geometry of {run} written",
    WriteKind.PROVISIONAL_TAKEN_BACK: "the provisional geometry of {run} undone by the run itself",
}


def write_text(write: ConfigWrite) -> str:
    """A write into the config: when and what; then who, how much and why."""
    one = write.record
    head = f"{one.at:%Y-%m-%d %H:%M:%S}  {_WRITES[one.kind].format(run=one.run)}"
    process = f", as {one.user} on {one.host}" if one.user else ""
    parts = [f"by {one.by}{process}", _how_much(one), write.why or "no verdict on it is known"]
    if one.reason:
        parts.append(f'given as the reason: "{one.reason}"')
    return "\n".join([wrapped(head, indent=2), *(wrapped(f"  {part}", indent=4) for part in parts)])


def _how_much(one: WriteRecord) -> str:
    files = files_named([Path(name) for name in names_of(one.files)])
    if one.numbers_changed is None:
        return f"{files}: how many numbers is not known"
    text = f"{files}: {counted(one.numbers_changed, 'number')}"
    if (most := one.largest) is None:
        return text
    return f"{text}, most of all {most.name} by {most.change:+.4f} {most.unit}".rstrip()


def files_named(paths: Sequence[Path], verb: str = "", verb_of_several: str = "") -> str:
    """The files of a config in a sentence, with its verb."""
    return f"{' and '.join(map(str, paths))} {verb_of_several if paths[1:] else verb}".rstrip()


def versions_text(versions: ConfigVersions) -> str:
    """The three versions of an edited config, number by number, and the edit itself."""
    origin = "the run wrote it" if versions.is_from_written else "it was before the run"
    width = max([9, *(len(one.name) + 1 for one in versions.numbers)])
    table = [f"{'number':{width}}{'before':>16}{'written':>16}{'now':>16}"]
    for one in versions.numbers:
        now = f"{'unreadable':>16}" if one.now is None else f"{one.now:16.6f}"
        edited = "  edited by hand" if one.is_edited else ""
        table.append(f"{one.name:{width}}{one.before:16.6f}{one.written:16.6f}{now}{edited}")
    if not versions.numbers:
        table = ["No number of the geometry or of the corrections differs."]
    return "\n".join([*table, f"The edit since {origin}:", versions.edit.rstrip("\n")])
