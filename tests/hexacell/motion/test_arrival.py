"""From which side joints arrive, against elements with hysteresis: what is said to be known is so."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import Pose
from hexacell.motion.arrival import STILL_SHARE, arrival_directions, least_way
from hexacell.motion.overshoot import clear_waypoint_before, waypoint_before
from hexacell.robot.model import robot_of

LEAST = 0.3
ways = st.sampled_from([0.0, 1e-5, 0.05, 0.2, 0.31, 2.0]) | st.floats(0.0, 1.0)
moves = st.lists(st.lists(st.tuples(ways, st.sampled_from([-1, 1])), max_size=4), min_size=1, max_size=6)


def along(place: float, turns: list[tuple[float, int]]) -> list[float]:
    """One joint through turns, each some way in a direction, sampled in between."""
    ends = [place, *(place + np.cumsum([sign * way for way, sign in turns]))]
    inside = [np.linspace(a, b, 7)[1:] for a, b in pairwise(ends)]
    return [place, *(value for part in inside for value in part)]


def arrived(way: list[float], before: int) -> int:
    """The direction of one joint."""
    return arrival_directions(np.repeat(np.array(way)[:, None], 6, axis=1), (before,) * 6, LEAST)[0]


@given(moves=moves, lost=st.floats(0.0, 0.95 * LEAST), inside=st.floats(-0.5, 0.5))
def test_what_is_known_is_where_an_element_with_hysteresis_is(moves, lost, inside):
    encoder, direction = 0.0, 0
    joint = encoder + inside * lost
    for number, turns in enumerate(moves, start=1):
        way = along(encoder, turns)
        direction, encoder = arrived(way, direction), way[-1]
        for value in way:
            joint = min(max(joint, value - 0.5 * lost), value + 0.5 * lost)
        if direction:
            within = number * STILL_SHARE * LEAST + 1e-9
            assert joint == pytest.approx(encoder - 0.5 * lost * direction, abs=within)
        if turns and turns[-1][0] > 1.01 * LEAST:
            assert direction == turns[-1][1]


@pytest.mark.parametrize(
    ("way", "before", "after"),
    [
        ([0.0, 0.2], 1, 1),
        ([0.0, 0.2], -1, 0),
        ([0.0, 0.2], 0, 0),
        ([0.0], -1, -1),
        ([0.0, -1.0, -0.8], 1, 0),
        ([0.0, -1.0, -0.8], -1, 0),
        ([0.0, 0.1, -0.1], -1, 0),
        ([0.0, np.nan, 2.0], -1, 0),
    ],
)
def test_short_ways(way, before, after):
    assert arrived(way, before) == after


@pytest.mark.parametrize("name", ["simulated-hexaglide", "gough-stewart", "rotary-cranks"])
def test_at_the_waypoint_every_joint_stands_short_of_its_stop(name):
    cell = load_cell(bundled_config(name))
    robot, reference = robot_of(cell), Pose(*cell.settings.identification.points[0], 3.0, -4.0, 2.0)
    belief, stop = robot.belief(), robot.from_commands([reference])
    for back in (0.45, -0.45):
        waypoint = waypoint_before(belief, stop, back)
        assert waypoint is not None
        ways = np.subtract(*map(belief.commanded.joints, (stop, waypoint)))
        assert ways == pytest.approx(np.full((1, 6), back), abs=1e-9)
    lowest = float(belief.commanded.joints(stop).min()) - 0.2
    beyond = replace(belief, limits=replace(belief.limits, joint_min=lowest))
    assert clear_waypoint_before(belief, stop, stop, 0.45, None) is not None
    assert clear_waypoint_before(beyond, None, stop, 0.45, None) is None


def test_a_machine_that_stops_beside_its_commands_must_go_farther():
    assert least_way(JointUnit.MM, 0.01) == 0.3
    assert least_way(JointUnit.MM, 0.2) == pytest.approx(1.0)
    assert least_way(JointUnit.DEG, 0.0) == 0.1
