"""A robot that somebody moved while the run waited: no way is planned from where it is no more."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.cell.recovery import Action
from hexacell.kinematics.pose import Pose
from procedures.engine.recovery import RecoveryPolicy
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from tests.procedures.runs.listening import happened, on, run_until


def jogs(rig: Any) -> Any:
    """A listener: after the third record somebody moves the robot by two millimetres."""

    def jog() -> None:
        here = rig.machine.pose()
        rig.machine.move(Pose(here.x + 2.0, here.y, here.z, here.a, here.b, here.c))

    return on(events.RecordTaken, jog, 3)


def moves(rig: Any) -> int:
    return sum(entry.startswith("move") for entry in rig.controller.log)


async def test_nothing_moves_and_the_message_says_where_the_robot_is(make_rig) -> None:
    rig = make_rig()
    sent: list[int] = []
    count = on(events.RecordTaken, lambda: sent.append(moves(rig)), 3)
    with pytest.raises(GuardTripped, match=r"and not at .*, where it arrived: it was moved") as tripped:
        await rig.run(jogs(rig), count)
    assert tripped.value.trip.guard is Guard.POSITION
    assert sent == [moves(rig)]


async def test_a_person_retries_and_the_run_plans_from_where_the_robot_is(make_rig) -> None:
    rig = make_rig()
    rig.operator.decisions = [Action.RETRY]
    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=True)
    await run_until(rig, events.SetClosed, jogs(rig), policy=policy)
    assert len(happened(rig, events.Located)) > 1
    assert len(rig.operator.problems) == 1
