"""A killed run that is resumed where the robot stands far from the open set's gauges."""

from __future__ import annotations

import pytest

from hexacell.errors import ExitCode
from procedures.steps import events
from procedures.steps.move import Move
from tests.procedures.runs.listening import happened, run_until


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
