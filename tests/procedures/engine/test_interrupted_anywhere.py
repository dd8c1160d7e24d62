"""Interrupted after any event, and again while it resumes: every record once, and a valid result."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.errors import ExitCode, Interruption
from procedures.engine.commands import Abort
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.engine.test_resume import require_whole_sets
from tests.procedures.runs.listening import PowerCut, on

TELLING = 125
"""Events of a whole run of the small cell, and a few more."""


async def ended_by_command(rig: Any, number: int) -> bool:
    """Run until somebody aborts at an event; whether it came to that."""
    try:
        await rig.run(on(object, lambda: rig.engine.command(Abort()), number))
    except Interruption:
        return True
    return False


async def ended_by_power_cut(rig: Any, number: int) -> bool:
    """Run until the process dies at an event: its journal ends there."""

    path = rig.folder.journal
    kept: list[bytes] = []

    def die() -> None:
        kept.append(path.read_bytes())
        raise PowerCut

    try:
        await rig.run(on(object, die, number))
    except PowerCut:
        path.write_bytes(kept[0])  # as if the engine had not got to say that it was interrupted
        return True
    return False


WAYS = {"aborted": ended_by_command, "power cut": ended_by_power_cut}


async def interrupted_twice(rig: Any, how: str, first: int, second: int) -> None:
    for number in (first, second):
        if await WAYS[how](rig, number):
            before = read_journal(rig.folder.journal)
            assert fold(before).ended is None
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    history = read_journal(rig.folder.journal)
    require_whole_sets(history)
    voided = [event.reason for event in history if isinstance(event, events.SetInvalidated)]
    assert set(voided) <= {"the run was interrupted in this set"}, "no set with a record was measured anew"


@pytest.mark.sample("3", "16")
@pytest.mark.parametrize("first", range(1, TELLING))
async def test_a_run_interrupted_after_any_event_and_again_finishes_with_every_record_once(make_rig, first):
    how = list(WAYS)[first % 2]
    await interrupted_twice(make_rig(), how, first, 1 + (7 * first) % 13)
