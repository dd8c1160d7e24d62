"""Paths keep the ball in the gauges' travel, and there is a way back from everywhere."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.design.candidates import commands_for, orientations, reachable_targets
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import paths as module
from hexacell.motion.path_check import ball_position, is_clear
from hexacell.motion.paths import WAYPOINT_PIECES, PathPlanner, find_route, next_return_move
from hexacell.motion.trajectory import interpolate_line
from hexacell.robot.model import robot_of

TRAVEL_MM = 5.0
BALL = np.array([0.0, 0.0, 550.0])


LARGE_TILT = np.radians(39.0)
"""The few commands beyond are next to a singularity, from which hardly any line leads away."""


@pytest.fixture(scope="module")
def well(know, paper):
    """The real robot, known well, behind the controller that has the drawing."""
    return know(paper.actual)


@pytest.fixture(scope="module")
def commands(well):
    """Commands that bring the ball to one place in many orientations."""
    stands = reachable_targets(well, PoseBatch.at(BALL, orientations(256, well.limits.tilt, seed=5)))
    found, held = commands_for(well, stands)
    return found[held]


@pytest.fixture(scope="module")
def home(well):
    stands = reachable_targets(well, PoseBatch.at(BALL, np.eye(3)[None]))
    return commands_for(well, stands)[0]


def farthest(well, line):
    """The largest deviation of the ball on lines over some commands, finely sampled."""
    away = 0.0
    for start, end in pairwise(line):
        way = interpolate_line(start, end, 60)
        joints = inverse_kinematics(well.mechanism, well.controller, well.branch, way)
        really = continue_solution(
            well.mechanism,
            well.estimate,
            joints,
            start=way,
            start_geometry=well.controller,
            start_joints=joints,
        )
        assert really.found.all()
        away = max(away, float(np.abs(really.poses.positions - BALL).max()))
    return away


def tilted_most(commands):
    tilts = commands.tilts()
    return commands[[int(np.argmax(np.where(tilts < LARGE_TILT, tilts, 0.0)))]]


def line_of(path, start, end):
    return [start, *(PoseBatch.of([stop]) for stop in path.waypoints), end]


def test_where_the_straight_line_leaves_the_travel_waypoints_keep_the_ball_inside(well, commands, home):
    """From one large tilt to others: few straight lines are safe, many paths over waypoints are."""
    start = tilted_most(commands)
    paths = PathPlanner(well, start, None, BALL).plan(commands)
    over_waypoints = [row for row, path in enumerate(paths) if path and path.waypoints]
    direct = [row for row, path in enumerate(paths) if path and not path.waypoints]
    assert len(over_waypoints) > len(direct) > 0
    for row in [*over_waypoints[:10], *direct[:5]]:
        path, end = paths[row], commands[[row]]
        assert path is not None
        seen = farthest(well, line_of(path, start, end))
        assert seen <= TRAVEL_MM + 0.1
        assert np.abs(path.poses.positions - BALL).max() == pytest.approx(seen, abs=0.3)
    for row in over_waypoints[:10]:
        path = paths[row]
        assert path is not None
        assert len(path.waypoints) == len(WAYPOINT_PIECES)
        assert farthest(well, [start, commands[[row]]]) > TRAVEL_MM


def test_over_the_reference_the_ball_stays_inside_as_well(well, commands, home):
    start = tilted_most(commands)
    planner = PathPlanner(well, start, home, BALL)
    over = planner.options(commands).via_reference(np.arange(len(commands)))
    found = [(row, path) for row, path in enumerate(over) if path is not None]
    assert len(found) > len(commands) // 4
    for row, path in found[:5]:
        assert home.pose(0) in path.waypoints
        assert farthest(well, line_of(path, start, commands[[row]])) <= TRAVEL_MM + 0.1


def test_there_is_no_path_over_the_reference_from_itself_nor_from_out_of_reach(well, commands, home):
    paths = PathPlanner(well, home, None, BALL).options(commands)
    assert list(paths.via_reference(np.array([0, 1]))) == [None, None]
    beyond = PoseBatch.at([0.0, 0.0, 5000.0], np.eye(3)[None])
    planner = PathPlanner(well, beyond, beyond, BALL)
    assert not any(planner.plan(commands))
    assert list(planner.options(commands).via_reference(np.array([0, 1]))) == [None, None]


TRAIL = [Pose(0, 0, 500, angle) for angle in (0, 5, 10, 15)]
WAYPOINT = Pose(1, 2, 500, 7, 3, 0)


@pytest.fixture
def plan(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands in for the planner and the check of lines: straight lines are clear to some angles only."""

    def planned(*waypoints: Pose, found: bool = True, clear_to: tuple[int, ...] = ()) -> list[float]:
        asked: list[float] = []

        def planner(_: Any, start: PoseBatch, *__: Any) -> Any:
            asked.append(start.pose(0).a)
            return SimpleNamespace(plan=lambda _: [SimpleNamespace(waypoints=waypoints) if found else None])

        monkeypatch.setattr(module, "PathPlanner", planner)
        monkeypatch.setattr(module, "is_clear", lambda _, __, end, ___: round(end.pose(0).a) in clear_to)
        return asked

    return planned


OFF = Pose(0, 0, 500, 20)


@pytest.mark.parametrize(
    ("stops", "clear_to", "here", "back"),
    [
        ([], (), [], 0),  # straight to the reference where that is safe
        ([WAYPOINT], (), [], WAYPOINT),
        ([WAYPOINT], (), [WAYPOINT], 0),
        (None, (5, 10), [], 1),  # without a path to the earliest pose that is clear
        (None, (), [], 2),  # without any clear line back along the trail
        ([WAYPOINT], (0,), [OFF], 0),
        ([WAYPOINT], (), [OFF], 3),  # off the planned path along the trail
    ],
)
def test_the_way_back_is_planned_from_the_last_pose_that_was_measured(plan, stops, clear_to, here, back):
    asked = plan(*(stops or ()), found=stops is not None, clear_to=clear_to)
    nothing: Any = None
    assert next_return_move(nothing, np.zeros(3), PoseBatch.of([*TRAIL, *here]), 3) == back
    assert asked == pytest.approx([15.0] * len(asked))


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
