"""A controller that refuses poses: they are journalled, never sent again, and the run goes on."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.errors import PoseRefused
from hexacell.campaign.pilots import FIRST_PILOT, MOST_PILOTS
from hexacell.cell.limits import NEAR_DEG, NEAR_MM
from hexacell.cell.recovery import Action
from hexacell.cell.simulation import SoftLimits
from hexacell.errors import ExitCode, IdentifiabilityError
from hexacell.kinematics.commanded_motion import RefusedCommand, RefusedCommands
from hexacell.kinematics.pose import Pose
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.run.trips import Guard, Trip
from procedures.steps import events
from tests.procedures.fakes import refused
from tests.procedures.runs.listening import P2, UNATTENDED, failing, happened, run_until

WIDE = 1e6


def limits(**axes: tuple[float, float]) -> dict[str, Any]:
    """Soft limits of some axes."""
    pairs = [axes.get(axis, (-WIDE, WIDE)) for axis in "xyzabc"]
    return {
        "simulation__soft_limits": SoftLimits(
            lowest=tuple(low for low, _ in pairs), highest=tuple(high for _, high in pairs)
        )
    }


def sent(rig: Any) -> Counter[str]:
    return Counter(entry for entry in rig.controller.log if entry.startswith("move"))


def excluded(rig: Any) -> list[events.PoseExcluded]:
    return happened(rig, events.PoseExcluded)


async def test_a_resumed_run_does_not_send_it_again(make_rig) -> None:
    rig = make_rig(**limits(c=(-5.0, 5.0)))
    await run_until(rig, events.PoseExcluded)
    (refusal,) = excluded(rig)
    await run_until(rig, events.SetClosed)
    assert sent(rig)[f"move {Pose(*refusal.pose)}"] == 1
    assert len(happened(rig, events.RecordTaken)) >= 9


async def test_too_few_points_that_are_not_refused_are_said_in_words(make_rig) -> None:
    rig = make_rig(**limits(x=(-50.0, 500.0)))
    with pytest.raises(IdentifiabilityError, match="point"):
        await rig.run()
    (refusal,) = [one for one in excluded(rig) if one.orientation == 1]
    assert (refusal.at.point, refusal.axis, refusal.is_highest) == (2, "x", False)


async def test_a_refused_held_out_pose_is_replaced_before_and_after(recording, replayed) -> None:
    history = recording.until(events.Identified)
    identified = fold(history).identified
    assert identified is not None
    pose = identified.held_out[0][1]
    column = int(np.argmax(np.abs(pose[3:]))) + 3
    axis, value = "xyzabc"[column], pose[column]
    bounds = (-WIDE, value - 1e-3) if value > 0 else (value + 1e-3, WIDE)
    rig = replayed(history, **limits(**{axis: bounds}))
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE, ended.line
    assert pose in [refusal.pose for refusal in excluded(rig)]
    assert sent(rig)[f"move {Pose(*pose)}"] == 1
    taken = happened(rig, events.RecordTaken)
    compared = [
        {one.pose for one in taken if one.at.phase is phase and one.at.point == 1 and one.orientation <= 3}
        for phase in (Phase.BEFORE, Phase.AFTER)
    ]
    assert compared[0] == compared[1], "the same poses are compared"
    assert len(compared[0]) == 3, "another took its place"
    new = {old: other for refusal in excluded(rig) for old, other in refusal.replacements}[pose]
    assert new in compared[0]
    assert (new[column] < value) == (value > 0)


async def test_a_held_out_point_whose_reference_is_refused_is_left(recording, replayed) -> None:
    # The gauges are placed anew although the robot stays at the one point that is left.
    reach = {"simulation__station_reach_mm": 8.0}
    rig = replayed(recording.until(events.Identified), **limits(z=(0.0, 545.0)), **reach)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE, ended.line
    keys = {taken.at for taken in happened(rig, events.RecordTaken)}
    assert {key.point for key in keys if key.phase is not Phase.IDENTIFY} == {1}


async def test_a_refused_pilot_pose_is_replaced_by_another(make_rig) -> None:
    rig = make_rig(**limits(x=(-500.0, 100.5)), noise__revisits=6)
    await run_until(rig, events.NoiseMeasured)
    assert {refusal.axis for refusal in excluded(rig)} == {"x"}
    assert all(refusal.orientation >= FIRST_PILOT for refusal in excluded(rig))
    assert len(happened(rig, events.PilotTaken)) == MOST_PILOTS
    assert len(happened(rig, events.ReferenceRepeated)) == 6


async def test_a_robot_that_moved_was_not_refused(make_rig) -> None:
    """A message of a limit that came on the way is a failure, not a refusal."""
    rig = make_rig()
    controller = rig.controller

    async def move(pose: Pose, duration_s: float) -> None:
        controller._do("move", str(pose))
        if len(sent(rig)) < 3:
            rig.machine.move(pose, duration_s)
            return
        there = Pose(pose.x + 1.0, pose.y, pose.z, pose.a, pose.b, pose.c)
        rig.machine.move(there, duration_s)
        raise refused(pose, "Linear move on line 0 would exceed C's positive limit")

    controller.move = move
    with pytest.raises(PoseRefused, match="would exceed C's positive limit"):
        await rig.run()
    assert not excluded(rig)


async def test_a_controller_that_refuses_one_pose_after_another_ends_the_run(make_rig):
    rig = make_rig()
    rig.performer = replace(rig.performer, most_refusals=3)
    controller, machine = rig.controller, rig.machine

    async def move(pose: Pose, duration_s: float) -> None:
        controller._do("move", str(pose))
        if pose.a or pose.b or pose.c:
            raise refused(pose, "Linear move on line 0 fails kinematicsInverse")
        machine.move(pose, duration_s)

    controller.move = move
    with pytest.raises(PoseRefused, match="fails kinematicsInverse"):
        await rig.run()
    assert len(excluded(rig)) == 3


async def test_a_pose_on_the_way_to_which_the_ball_left_its_plates_is_not_chosen_again(make_rig) -> None:
    """The robot is not where the estimate holds it for, so that the same choice would fail as often."""
    rig = make_rig()
    off_plate = Trip(
        Guard.PLATE, "gauge y", "the ball is +5.53 mm from its reference", "Look at it"
    ).as_error()
    struck = failing("P2/o03/move", lambda: rig.controller.failures.update(move=off_plate))
    await run_until(rig, events.SetClosed, struck, count=2, policy=UNATTENDED)
    (failed,) = happened(rig, events.Failed)
    assert failed.action is Action.REDO_SET
    near = RefusedCommands((RefusedCommand(failed.step.pose, within_mm=NEAR_MM, within_deg=NEAR_DEG),))
    taken = [one for one in happened(rig, events.RecordTaken) if one.at == P2]
    assert len(taken) >= 9
    assert [one.orientation for one in taken[2:] if not near.allows(one.pose)] in ([], [1]), (
        "it goes on from there"
    )
    assert sent(rig)[f"move {Pose(*failed.step.pose)}"] == 1
