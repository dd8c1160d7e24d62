"""A config edited during a run is noticed before the next move; once that is undone, the run goes on."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.errors import ExitCode, FileError, HexacellError
from procedures.engine.commands import UnattendedOperator
from procedures.engine.recovery import RecoveryPolicy
from procedures.steps import events
from tests.procedures.runs.listening import happened, on, run_until


def edits(rig: Any, kind: type[Any], count: int) -> Any:
    """A listener that changes the seventh line of the config at an event."""
    path = rig.cell.config_path
    lines = path.read_bytes().split(b"\n")

    def edit() -> None:
        path.write_bytes(b"\n".join([*lines[:6], b"# " + lines[6], *lines[7:]]))

    return on(kind, edit, count)


async def test_an_edit_is_noticed_before_the_next_move_and_the_file_and_line_are_named(make_rig) -> None:
    rig = make_rig()
    with pytest.raises(FileError, match="Undo the edit and retry") as noticed:
        await rig.run(edits(rig, events.RecordTaken, 3))
    assert str(noticed.value).startswith(
        f"{rig.cell.config_path}:7: the config changed since the run began"
    )
    assert noticed.value.exit_code is ExitCode.USAGE
    taken = happened(rig, events.RecordTaken)
    assert len(taken) == 3
    assert len([entry for entry in rig.controller.log if entry.startswith("move")]) == 3


async def test_an_unattended_run_ends_and_is_resumed_once_the_edit_is_undone(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed), operator=UnattendedOperator())
    before = rig.config
    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=False)
    with pytest.raises(FileError, match="Undo the edit"):
        await rig.run(edits(rig, events.RecordTaken, 2), policy=policy)
    log = list(rig.controller.log)
    with pytest.raises(FileError, match="Undo the edit"):
        await rig.run(policy=policy)
    assert rig.controller.log[len(log) :] == ["stop"], "not even prepared"
    rig.cell.config_path.write_bytes(before)
    rig.operator.name = None
    await run_until(rig, events.SetClosed, policy=policy)


async def test_an_edit_of_the_written_config_is_noticed_too(recording, replayed) -> None:
    rig = replayed(recording.until(events.Committed))
    with pytest.raises(HexacellError, match="Undo the edit and retry"):
        await rig.run(edits(rig, events.Located, 1))
    assert not happened(rig, events.ResultValidated)


async def test_an_edited_provisional_config_is_not_loaded_in_place_of_the_old_one(recording, replayed):
    rig = replayed(recording.until(events.SetClosed), identification__provisional=True)
    with pytest.raises(FileError, match="Undo the edit and retry"):
        await rig.run(edits(rig, events.SetClosed, 1))
    assert rig.controller.log.count("reload") == 1, "the provisional geometry alone was loaded"
