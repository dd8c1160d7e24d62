"""An attended run asks a person what is done about a failure; a fault latches meanwhile."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from drivers.errors import (
    GaugeSilent,
)
from hexacell.cell.recovery import Action
from hexacell.errors import (
    ExitCode,
    Interruption,
)
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, Pause, Resume
from procedures.steps import events
from tests.procedures.engine.injected_failures import (
    ATTENDED,
    KEY,
    SILENT,
    failing,
    until_closed,
)
from tests.procedures.runs.listening import happened
from tests.waiting import until


@pytest.mark.parametrize(
    ("choice", "voided"), [(Action.RETRY, 0), (Action.MEASURE_AGAIN, 1), (Action.REDO_SET, 1)]
)
async def test_the_recovery_chosen_by_the_operator_is_executed(at_second_point, choice, voided) -> None:
    rig = at_second_point
    rig.operator.decisions = [choice]
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    assert await until_closed(rig, silent, policy=ATTENDED)
    assert rig.operator.problems == ["gauge y: does not answer"]
    (failure,) = happened(rig, events.Failed)
    assert (failure.action, failure.asked) == (choice, True)
    assert len(happened(rig, events.SetInvalidated)) == voided, (
        "a gauge that was opened again costs the set"
    )


async def test_an_operator_who_chooses_abort_ends_the_run(at_second_point) -> None:
    rig = at_second_point
    rig.operator.decisions = [Action.ABORT]
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    with pytest.raises(GaugeSilent):
        await rig.run(silent, policy=ATTENDED)
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.HARDWARE


async def test_a_fault_rejects_other_commands_until_it_is_answered(at_second_point) -> None:
    rig = at_second_point
    asked = asyncio.Event()

    async def never(*_: Any) -> Action:
        asked.set()
        await asyncio.Event().wait()
        return Action.ABORT

    rig.operator.ask = never
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    running = asyncio.create_task(until_closed(rig, silent, policy=ATTENDED))
    await asked.wait()
    moves = len(rig.controller.log)
    for command in (Resume(), Pause()):
        rig.engine.command(command)
    await until(lambda: len(happened(rig, events.CommandRejected)) == 2)
    assert rig.engine.status is Status.FAULTED
    assert len(rig.controller.log) == moves, "nothing moves under a fault"
    rig.engine.command(Answer("retry"))
    assert await running
    assert [event.command for event in happened(rig, events.CommandRejected)] == ["Resume", "Pause"]


async def test_a_faulted_run_can_be_aborted(at_second_point) -> None:
    rig = at_second_point

    async def leave(*_: Any) -> Action:
        rig.engine.command(Abort())
        await asyncio.Event().wait()
        return Action.RETRY

    rig.operator.ask = leave
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    with pytest.raises(Interruption):
        await rig.run(silent, policy=ATTENDED)
