"""``hexacell apply`` and ``rollback``: a proposal written into the controller's config, and undone."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.cli.terminal import SignalCommands, TerminalOperator, is_interactive
from hexacell.config.pending_write import settle_config
from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import ExitCode
from hexacell.runs.run_folder import RunFolder
from hexacell.services.write_back.config_rollback import ConfigRollback, roll_back_config
from hexacell.services.write_back.proposals import apply_proposal, read_proposal
from hexacell.text.config_changes import applied_text, rollback_text, versions_text
from hexacell.text.verdict import teaching_sentence
from procedures.engine.commands import UnattendedOperator


def apply_run(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write the proposal of a run; a person is asked where a gate needs one. No signal ends a write."""
    proposal = read_proposal(RunFolder(options.run))
    if (settled := settle_config(*proposal.change.paths)) is not None:
        console.warn(settled)
    operator = TerminalOperator(console) if is_interactive() else UnattendedOperator()
    with _edits_shown(console):
        applied = SignalCommands(console).run(apply_proposal(proposal, operator, reason=options.reason))
    change, moved = proposal.change, proposal.displacement
    document = {
        "applied": bool(applied.by),
        "by": applied.by or None,
        "config": change.path,
        "further_configs": change.paths[1:],
        "run": proposal.folder.path,
        "sha256": change.sha256_after,
        "teach": teaching_sentence(moved) or None,
        "recorded": not applied.unrecorded,
    }
    console.show(document, applied_text(applied))
    return ExitCode.DONE


def rollback_config(options: argparse.Namespace, console: Console) -> ExitCode:
    """Undo the latest write, or restore what a run wrote."""

    async def rolled_back() -> ConfigRollback:
        return roll_back_config(cell_at(options.cell, console), options.to, reason=options.reason)

    with _edits_shown(console):
        done = SignalCommands(console).run(rolled_back())
    document = {
        "restored": bool(done.change),
        "config": done.paths[0],
        "further_configs": done.paths[1:],
        "from": done.restored[0],
        "undone": done.undone,
        "recorded": not done.unrecorded,
    }
    console.show(document, rollback_text(done))
    return ExitCode.DONE


@contextmanager
def _edits_shown(console: Console) -> Iterator[None]:
    try:
        yield
    except ConfigEditedSince as edited:
        console.error(versions_text(edited.versions))
        raise
