"""Every move of a run gets a duration, by where gauges are; simulated sliders keep to the speeds."""

from typing import Any

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.trajectory import SHORTEST_S
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.move import Move, gauges_are_at_ball
from tests.procedures.story import READING, located

P1, P2 = (SetKey(phase=Phase.IDENTIFY, point=point) for point in (1, 2))
L1 = SetKey(phase=Phase.LENGTH, point=1)
POSE = (100.0, -100.0, 500.0, 0.0, 0.0, 0.0)
NEXT = (100.0, -100.0, 500.0, 5.0, 0.0, 0.0)


def arrived(at: SetKey, orientation: int = 1) -> events.Arrived:
    return events.Arrived(at=at, orientation=orientation, pose=POSE)


def move(at: SetKey, orientation: int = 2) -> Move:
    return Move(at=at, orientation=orientation, pose=NEXT)


def placed(at: SetKey) -> events.GaugesPlaced:
    return events.GaugesPlaced(at=at)


CLOSED = events.SetClosed(at=P1, drift_mm=(0.0, 0.0, 0.0), reading=READING)


@pytest.mark.parametrize(
    ("history", "step", "there"),
    [
        ([], move(P1, 1), False),
        ([arrived(P1)], move(P1), False),
        ([arrived(P1), placed(P1)], move(P1), True),
        ([arrived(P1), placed(P1), arrived(P1, 0)], move(P1), True),
        ([arrived(P1), placed(P1), CLOSED], move(P2, 1), True),
        ([arrived(P1), placed(P1), CLOSED, arrived(P2, 0)], move(P2, 1), False),
        ([arrived(P1), placed(P1), located(POSE)], move(P2, 1), True),
    ],
)
def test_gauges_placed_by_hand_are_at_the_ball_from_then_until_the_robot_has_left(
    make_rig: Any, history: Any, step: Move, there: bool
) -> None:
    settings = make_rig(stations__placement="by-hand").cell.settings
    assert gauges_are_at_ball(settings, step.at, fold(history)) is there


def test_fixed_gauges_are_everywhere(make_rig: Any) -> None:
    fixed = make_rig().cell.settings
    assert gauges_are_at_ball(fixed, P1, RunState())
    by_hand = make_rig(stations__placement="by-hand").cell.settings
    assert gauges_are_at_ball(by_hand, L1, RunState()), "the seats of the fixture are fixed ones"


async def test_a_move_with_gauges_at_the_ball_is_as_much_slower_as_stated(make_rig: Any) -> None:
    rig = make_rig(stations__placement="by-hand", speed__joint=40.0, speed__edge_mm_s=40.0)
    back = Move(at=P1, orientation=1, pose=POSE)
    there = events.Arrived(at=P1, orientation=2, pose=NEXT)
    steps: list[tuple[Move, list[events.Event]]] = [
        (back, []),
        (move(P1), [arrived(P1)]),
        (back, [there]),
        (move(P1), [arrived(P1), placed(P1)]),
    ]
    for step, history in steps:
        await rig.performer.perform(step, fold(history))
    _, free_s, _, at_gauges_s = rig.controller.durations_s
    assert at_gauges_s == pytest.approx(free_s * 40.0 / 25.0)


@pytest.mark.slow
async def test_in_a_whole_run_no_slider_and_no_point_of_the_platform_is_faster_than_allowed(
    recording, replayed
):
    rig = replayed(recording.until(events.SetClosed, count=1))
    fastest = {"joint": 0.0, "edge": 0.0}
    real = rig.machine.move

    def watched(pose: Pose, duration_s: float) -> None:
        real(pose, duration_s)
        motion = rig.physics._motion
        rate = 1.0 / (motion.duration_s - 0.2)  # of the path a second, between the ramps
        rows = np.diff(motion.path, axis=0) * rate * (len(motion.path) - 1)
        fastest["joint"] = max(fastest["joint"], float(np.abs(rows).max()))
        line = rig.machine._line
        edge = line.positions[:, None] + rig.calibration.robot.controller["B"] @ np.swapaxes(
            line.rotations, 1, 2
        )
        steps = np.linalg.norm(np.diff(edge, axis=0), axis=2) * rate * (len(line) - 1)
        fastest["edge"] = max(fastest["edge"], float(steps.max()))

    rig.machine.move = watched
    rig.controller.machine = rig.machine
    await rig.run()
    speed = rig.cell.settings.speed
    assert 0.9 * speed.joint_at_gauges < fastest["joint"] < 1.01 * speed.joint_at_gauges
    assert fastest["edge"] < 1.1 * speed.edge_at_gauges_mm_s, "another geometry after the write-back"
    assert min(rig.controller.durations_s) >= SHORTEST_S
    assert isinstance(rig.machine._line, PoseBatch)
