"""Every move of a run gets a duration, by where gauges are."""

from typing import Any

import pytest

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
