"""What measuring costs, what a budget still allows, and how records are shared among points."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.campaign.budget import MOST_SHARE, Budget, paid_sizes, shared_sizes
from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.time_model import (
    USUAL,
    Overheads,
    TimeKind,
    TimeModel,
    calibration_seconds,
    lost_to_speed,
    planned_records,
    seconds_beside,
)
from hexacell.dry_run.campaign import VirtualCampaign, dry_run
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.motion.durations import SpeedLimits, line_duration
from hexacell.robot.virtual_robot import VirtualRobot

SLOW = SpeedLimits(joint=25.0, edge_mm_s=25.0)
TIMES = TimeModel(
    place_s=300.0,
    trial_s=5.0,
    station_s=30.0,
    reading_s=1.0,
    move_s=29.0,
    wide_move_s=9.0,
    speeds=SLOW,
    overheads=USUAL,
)


@pytest.mark.parametrize(
    ("most_records", "most_minutes", "records", "stations", "left"),
    [
        (None, None, 1000, 100, math.inf),
        (20, None, 0, 0, 20),
        (20, None, 19, 2, 1),
        (20, None, 30, 3, 0),
        (None, 20.0, 0, 1, 29),
        (None, 20.0, 29, 1, 0),
        (None, 20.0, 0, 2, 18),
        (None, 20.0, 0, 5, 0),
        (10, 20.0, 0, 1, 10),
        (100, 20.0, 0, 1, 29),
    ],
)
def test_the_tighter_of_records_and_minutes_holds(most_records, most_minutes, records, stations, left):
    """Minutes are those after points of 5 minutes, and after going to and trying gauges there."""
    assert Budget(most_records, most_minutes).records_left(records, stations, TIMES) == left
    if most_minutes is not None:
        later = Budget(most_records, most_minutes + 3.0, reserved=3.0)
        assert later.records_left(records, stations, TIMES) == left


def test_durations_of_a_cell(make_plan):
    by_hand = {"stations__placement": "by-hand", "identification__minutes_per_station": 7.0}
    assert TimeModel.of(make_plan(**by_hand).settings).place_s == 420.0
    carried, fixed = TimeModel.of(make_plan(**by_hand).settings), TimeModel.of(make_plan().settings)
    assert fixed.place_s == fixed.trial_s == 0.0, "fixed gauges are not carried, and tried once"
    untried = TimeModel.of(make_plan(stations__trial_mm=0.0, **by_hand).settings)
    assert untried.trial_s == 0.0
    assert carried.station_s == pytest.approx(untried.station_s + carried.trial_s)
    once, never = (
        sum(seconds_beside(make_plan(stations__trial_mm=size).settings).values()) for size in (1.0, 0.0)
    )
    assert once - never == pytest.approx(carried.trial_s)
    slow, fast = (
        TimeModel.of(make_plan(speed__joint_at_gauges=speed, speed__edge_at_gauges_mm_s=speed).settings)
        for speed in (10.0, 40.0)
    )
    assert slow.move_s - USUAL.move_s == pytest.approx(4.0 * (fast.move_s - USUAL.move_s))


def test_a_cell_takes_what_its_own_run_took(make_plan):
    plan, own = make_plan(), Overheads(move_s=1.3, reading_s=0.8)
    usual, slower = dry_run(plan), dry_run(plan, own)
    assert slower.records == usual.records
    readings = slower.seconds[TimeKind.READING] - usual.seconds[TimeKind.READING]
    moves = slower.seconds[TimeKind.MOVING] - usual.seconds[TimeKind.MOVING]
    assert readings > 0.5 * slower.records
    assert moves > 1.0 * slower.records
    by_hand = make_plan(stations__placement="by-hand").settings
    assert TimeModel.of(by_hand, Overheads(place_s=50.0)).place_s == 50.0


def test_a_calibration_takes_what_its_parts_take(make_plan):
    settings = make_plan().settings
    whole, beside = calibration_seconds(settings), seconds_beside(settings)
    assert all(whole[kind] >= beside[kind] for kind in TimeKind)
    times, plan = TimeModel.of(settings), settings.identification
    records, points = len(plan.points) * plan.orientations, len(plan.points)
    more = sum(whole.values()) - sum(beside.values())
    assert more == pytest.approx(60.0 * times.minutes(records, points))
    assert 0.3 < 60.0 * lost_to_speed(settings) / whole[TimeKind.MOVING] < 0.5, "but for overheads, half"


@pytest.mark.parametrize("minutes", [7.0, 12.0])
def test_a_budget_in_minutes_is_what_a_calibration_is_expected_to_take(make_plan, minutes):
    settings = make_plan(identification__budget_minutes=minutes).settings
    assert sum(calibration_seconds(settings).values()) == pytest.approx(60.0 * minutes, rel=0.01)
    listed = make_plan().settings
    assert planned_records(listed) == len(listed.identification.points) * listed.identification.orientations


@pytest.mark.parametrize("minutes", [7.5, 9.0])
def test_a_budget_in_minutes_is_what_the_whole_run_takes(make_plan, paper, minutes):
    plan = make_plan(identification__budget_minutes=minutes, identification__orientations=3)
    campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, paper.actual, np.random.default_rng(2)))
    campaign.carry_out()
    beside = sum(seconds_beside(plan.settings).values()) / 60.0
    assert campaign.minutes + beside == pytest.approx(minutes, rel=0.07)
    assert len(campaign.measurements) > 5 * 3
    assert campaign.state.begun_points == 5


def test_ways_between_records_say_how_long_the_next_ones_take(make_plan):
    plan = make_plan()
    robot, times = plan.robot, TimeModel.of(plan.settings)
    poses = [Pose(0.0, 0.0, 550.0, 6.0 * (number % 2)) for number in range(12)]
    joints = robot.mechanism.inverse(robot.controller, robot.branch, robot.from_commands(poses))
    records = [
        Record(1, number + 1, pose, tuple(row), (0.0, 0.0, 0.0))
        for number, (pose, row) in enumerate(zip(poses, joints.tolist(), strict=True))
    ]
    assert times.after(robot, records[:4]) == times, "too few"
    between = times.after(robot, records)
    assert between.reading_s == times.reading_s
    start, end = poses[:2]
    exact = line_duration(robot.mechanism, robot.controller, robot.branch, start, end, times.speeds)
    assert between.move_s == pytest.approx(exact + USUAL.move_s, rel=0.1)


PLANNED = {1: 11, 2: 11, 3: 11, 4: 11, 5: 11}


def measured(counts: dict[int, int], done: set[int], point: int | None = None) -> CampaignState:
    """A state with so many records at each point."""
    zeros = (0.0,) * 6, (0.0,) * 3
    records = tuple(
        Record(at, number, Pose(0.0, 0.0, 0.0), *zeros)
        for at, count in counts.items()
        for number in range(1, count + 1)
    )
    return CampaignState(MeasurementSet(records), point, frozenset(done))


@pytest.mark.parametrize(
    ("state", "unreachable", "changed"),
    [
        (measured({}, set()), set(), {}),
        (measured({1: 11, 2: 4}, {1}, 2), set(), {}),
        (measured({1: 11, 2: 4}, {1}, 2), {5}, {2: 14, 3: 14, 4: 14}),
        (measured({1: 11, 2: 14, 3: 14, 4: 9}, {1, 2, 3}, 4), {5}, {4: 16}),
        (measured({1: 11}, {1, 2, 3, 4, 5}), set(), {}),
        (measured({1: 11, 2: 14, 3: 14}, {1, 2, 3}, 4), set(), {}),
        (measured({1: 22}, {1}), set(), {}),
    ],
    ids=["none", "begun", "one out of reach", "the last one", "all done", "in reach again", "too many"],
)
def test_the_others_share_what_a_point_does_not_get(state, unreachable, changed) -> None:
    assert shared_sizes(PLANNED, state, unreachable) == PLANNED | changed


def test_one_point_takes_at_most_twice_its_own() -> None:
    assert shared_sizes(PLANNED, measured({1: 3, 2: 5}, {1}, 2), set())[2] == 13, "8 among 4"
    assert shared_sizes(PLANNED, measured({1: 4}, set(), 1), {2, 3, 4, 5})[1] == 22


@given(
    st.lists(st.integers(0, 20), min_size=5, max_size=5),
    st.sets(st.integers(1, 5)),
    st.sets(st.integers(1, 5)),
)
def test_no_point_gets_fewer_than_planned_and_all_together_no_more(counts, done, left) -> None:
    state = measured(dict(zip(PLANNED, counts, strict=True)), done)
    sizes = shared_sizes(PLANNED, state, left)
    waiting = set(PLANNED) - done - left
    assert all(PLANNED[point] <= sizes[point] <= MOST_SHARE * PLANNED[point] for point in PLANNED)
    asked = sum(sizes[point] for point in waiting)
    taken = sum(state.records_at(point) for point in set(PLANNED) - waiting)
    planned = sum(PLANNED[point] for point in waiting)
    assert asked == planned or asked + taken <= sum(PLANNED.values())


def test_minutes_are_shared_by_the_points_that_are_not_done():
    minutes = 5.0 * 5.5 + 45 * 0.5
    budget = Budget(None, minutes)
    assert paid_sizes(PLANNED, measured({}, set()), frozenset(), budget, TIMES) == dict.fromkeys(PLANNED, 9)
    later = paid_sizes(PLANNED, measured({1: 20, 2: 3}, {1}, 2), frozenset({5}), budget, TIMES)
    assert (later[1], later[5]) == (11, 11), "what is done or out of reach keeps its plan"
    assert later[2] == later[3] == later[4] > 9, "a point less is to be gone to"
    cost = sum(later[point] for point in (2, 3, 4)) * 0.5 + 20 * 0.5 + 4 * 5.5
    assert cost <= minutes
