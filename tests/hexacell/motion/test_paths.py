"""Paths with gauges at the ball: straight, over waypoints, or over the reference."""

from itertools import pairwise

import numpy as np
import pytest

from hexacell.design.candidates import commands_for, orientations, reachable_targets
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import PoseBatch
from hexacell.motion.paths import WAYPOINT_PIECES, PathPlanner
from hexacell.motion.trajectory import interpolate_line

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


def test_from_the_reference_itself_there_is_no_path_over_it(well, commands, home):
    paths = PathPlanner(well, home, None, BALL).options(commands)
    assert list(paths.via_reference(np.array([0, 1]))) == [None, None]


def test_there_is_no_path_from_a_command_out_of_reach(well, commands):
    beyond = PoseBatch.at([0.0, 0.0, 5000.0], np.eye(3)[None])
    planner = PathPlanner(well, beyond, beyond, BALL)
    assert not any(planner.plan(commands))
    assert list(planner.options(commands).via_reference(np.array([0, 1]))) == [None, None]
