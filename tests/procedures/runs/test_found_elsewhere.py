"""A robot that is not where the run left it: resumed far from the gauges, or moved while the run waited."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.cell.recovery import Action
from hexacell.errors import ExitCode
from hexacell.kinematics.pose import Pose
from procedures.engine.recovery import RecoveryPolicy
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from procedures.steps.move import Move
from tests.procedures.runs.listening import happened, on, run_until


def returns(rig, since: int) -> list[Move]:
    """The moves of a resumed run up to where a reference is read again."""
    history = happened(rig, object)[since:]
    end = next(
        n for n, event in enumerate(history) if getattr(event, "kind", "") in {"confirmed", "voided"}
    )
    steps = [event.step for event in history[:end] if isinstance(event, events.StepBegun)]
    return [step for step in steps if isinstance(step, Move)]


@pytest.mark.sample("this point")
@pytest.mark.parametrize(
    ("records", "from_elsewhere"), [(13, True), (5, False)], ids=["other point", "this point"]
)
async def test_only_a_robot_far_from_the_gauges_returns_without_them(
    recording, replayed, records: int, from_elsewhere: bool
) -> None:
    """The simulated robot is at its home when a run is resumed, which is the first point."""
    history = recording.until(events.RecordTaken, count=records)
    rig = replayed(history)
    await run_until(rig, events.SetClosed)
    moves = returns(rig, len(history))
    assert moves
    assert moves[0].from_elsewhere is from_elsewhere


async def test_gauges_at_their_ends_on_the_way_back_are_no_verdict_on_a_written_geometry(
    recording, replayed
) -> None:
    """The ball is not at them, whatever they show meanwhile."""
    last = sum(isinstance(event, events.RecordTaken) for event in recording.history)
    history = recording.until(events.RecordTaken, count=last - 1)
    rig = replayed(history)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert returns(rig, len(history))[0].from_elsewhere
    assert not happened(rig, events.RolledBack)


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
