"""Routes of straight lines: the fewest that are clear, or none."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import paths as module
from hexacell.motion.path_check import ball_position, is_clear
from hexacell.motion.paths import find_route
from hexacell.robot.model import robot_of


def at(place: float) -> PoseBatch:
    return PoseBatch.of([Pose(place, 0.0, 500.0)])


class Lines:
    """Stands in for the check: only some lines are clear; a place is the x of its pose."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *clear: tuple[float, float]) -> None:
        self.clear = set(clear)
        self.asked: list[tuple[float, float]] = []
        monkeypatch.setattr(module, "is_clear", self)

    def __call__(self, _: Any, start: PoseBatch, end: PoseBatch, reference: Any) -> bool:
        line = float(start.positions[0, 0]), float(end.positions[0, 0])
        self.asked.append(line)
        return line in self.clear


VIA = [at(1.0), at(2.0), at(3.0)]
START, GOAL = at(0.0), at(9.0)


@pytest.mark.parametrize(
    ("clear", "route"),
    [
        ([(0, 9)], []),
        ([(0, 9), (0, 1), (1, 9)], []),
        ([(0, 2), (2, 9)], [1]),
        ([(0, 1), (1, 3), (3, 9)], [0, 2]),
        ([(0, 1), (1, 2), (2, 3), (3, 9), (0, 3)], [2]),
        ([(0, 1), (1, 2), (2, 3)], None),
        ([(9, 0)], None),
        ([], None),
    ],
)
def test_the_fewest_lines(monkeypatch: pytest.MonkeyPatch, clear: Any, route: list[int] | None) -> None:
    lines = Lines(monkeypatch, *clear)
    nothing: Any = None
    assert find_route(nothing, START, GOAL, VIA) == route
    assert len(lines.asked) == len(set(lines.asked)), "no line is checked twice"


@pytest.fixture(scope="module")
def belief() -> Any:
    return robot_of(load_cell(bundled_config("simulated-hexaglide"))).belief()


def test_a_route_over_level_poses_on_the_papers_robot(belief: Any) -> None:
    """Far apart and with another tilt: each line of the route passes the check."""
    start, goal = (
        PoseBatch.of([Pose(100.0, -100.0, 500.0, 25.0, 20.0, 0.0)]),
        PoseBatch.of([Pose(-100.0, 100.0, 500.0)]),
    )
    via = [PoseBatch.of([Pose(100.0, -100.0, 500.0)]), goal]
    way = find_route(belief, start, goal, via)
    assert way is not None
    stops = [start, *(via[row] for row in way), goal]
    assert all(is_clear(belief, here, there) for here, there in pairwise(stops))


def test_the_ball_of_a_robot_as_drawn_is_where_it_is_commanded(belief: Any) -> None:
    ball = ball_position(belief, PoseBatch.of([Pose(10.0, -20.0, 550.0, 5.0, 0.0, 0.0)]))
    assert ball is not None
    assert np.abs(ball - [10.0, -20.0, 550.0]).max() < 1e-6
