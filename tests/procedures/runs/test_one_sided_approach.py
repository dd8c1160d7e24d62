"""Stops that are all reached from one side: what joints with backlash then do, and waypoints refused."""

from typing import Any

import pytest

from hexacell.errors import ExitCode
from hexacell.kinematics.pose import Pose
from procedures.steps import events
from procedures.steps.locate import Located
from tests.procedures.fakes import refused
from tests.procedures.runs.listening import happened, run_until

BACKLASH = {"simulation__joints__backlash": 0.1}


def directions(rig: Any) -> set[tuple[int, ...]]:
    kinds = (events.RecordTaken, events.SetClosed)
    return {event.reading.directions for kind in kinds for event in happened(rig, kind)}


@pytest.mark.slow
async def test_with_backlash_a_run_repeats_as_without_and_passes(make_rig) -> None:
    rig = make_rig(motion__approach="one-sided", **BACKLASH)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert directions(rig) == {(1,) * 6}
    assert all(max(map(abs, closed.drift_mm)) < 0.02 for closed in happened(rig, events.SetClosed))
    assert not any(arrived.straight for arrived in happened(rig, events.Arrived))


async def test_the_side_may_be_the_other_one(make_rig) -> None:
    rig = make_rig(motion__approach="one-sided", motion__direction="negative", **BACKLASH)
    await run_until(rig, events.SetClosed)
    assert directions(rig) == {(-1,) * 6}


@pytest.mark.parametrize("is_waypoint", [True, False])
async def test_where_a_waypoint_is_refused_the_robot_goes_straight(make_rig, is_waypoint: bool) -> None:
    """Where the stop is refused from its waypoint the run goes on from there, to another pose."""
    rig = make_rig(motion__approach="one-sided")
    controller, number = rig.controller, 3 if is_waypoint else 4

    async def move(pose: Pose, duration_s: float) -> None:
        controller._do("move", str(pose))
        if sum(entry.startswith("move") for entry in controller.log) == number:
            raise refused(pose, "Linear move on line 0 fails kinematicsInverse")
        rig.machine.move(pose, duration_s)

    controller.move = move
    await run_until(rig, events.RecordTaken, count=3)
    (excluded,) = happened(rig, events.PoseExcluded)
    assert (excluded.orientation, excluded.has_left) == ((0, False) if is_waypoint else (2, True))
    assert len(happened(rig, Located)) == (1 if is_waypoint else 2)
    straight = [arrived for arrived in happened(rig, events.Arrived) if arrived.straight]
    assert [arrived.orientation for arrived in straight] == ([2] if is_waypoint else [])
    assert all("no waypoint before it" in arrived.text(rig.engine.state) for arrived in straight)
    assert len(directions(rig)) == (2 if is_waypoint else 1), "of straight moves the path tells them"
