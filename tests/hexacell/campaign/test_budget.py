"""What measuring costs, what a budget still allows, and how records are shared among points."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.campaign.budget import (
    MOST_SHARE,
    MOVE_OVERHEAD_S,
    Budget,
    TimeModel,
    shared_sizes,
    usual_move_seconds,
)
from hexacell.campaign.decisions import CampaignState
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record


def test_minutes_are_of_points_records_and_references_read_again():
    pace = TimeModel(point_minutes=5.0, record_seconds=30.0)
    assert pace.minutes(10, 2) == pytest.approx(2 * 5.0 + 12 * 0.5)


def test_without_a_limit_all_records_are_left():
    assert Budget(None, None, TimeModel(5.0, 30.0)).records_left(1000, 100) == math.inf


@pytest.mark.parametrize(("records", "stations", "left"), [(0, 0, 20), (19, 2, 1), (20, 2, 0), (30, 3, 0)])
def test_records_are_counted(records, stations, left):
    assert Budget(20, None, TimeModel(5.0, 30.0)).records_left(records, stations) == left


@pytest.mark.parametrize(("records", "stations", "left"), [(0, 1, 29), (29, 1, 0), (0, 2, 18), (0, 5, 0)])
def test_minutes_left_are_those_after_points_and_references_read_again(records, stations, left):
    assert Budget(None, 20.0, TimeModel(5.0, 30.0)).records_left(records, stations) == left


def test_the_tighter_limit_holds():
    assert Budget(10, 20.0, TimeModel(5.0, 30.0)).records_left(0, 1) == 10
    assert Budget(100, 20.0, TimeModel(5.0, 30.0)).records_left(0, 1) == 29
    assert Budget(100, 20.0, TimeModel(5.0, 30.0)).description == "100 records or 20 minutes"


def test_durations_of_a_cell(make_plan):
    by_hand = {"stations__placement": "by-hand", "identification__minutes_per_station": 7.0}
    assert TimeModel.of(make_plan(**by_hand).settings).point_minutes == 7.0
    assert TimeModel.of(make_plan().settings).point_minutes == 0.0, "fixed gauges are not carried"
    timing = {"timing__move_s": 2.0, "timing__window_s": 1.0}
    seconds = [
        TimeModel.of(make_plan(**timing, **others).settings).record_seconds
        for others in ({"identification__poses": "list.csv"}, {"identification__provisional": True}, {})
    ]
    assert seconds[0] == 3.0
    assert seconds[0] < seconds[1] < seconds[2] < 12.0, "stops on the way are moves as well"
    stated = make_plan(identification__seconds_per_record=9.0)
    assert TimeModel.of(stated.settings).record_seconds == 9.0


def test_a_move_takes_as_long_as_its_largest_speeds_let_it(make_plan):
    slow, fast = (
        usual_move_seconds(
            make_plan(speed__joint_at_gauges=speed, speed__edge_at_gauges_mm_s=speed).settings
        )
        for speed in (10.0, 40.0)
    )
    assert slow - MOVE_OVERHEAD_S == pytest.approx(4.0 * (fast - MOVE_OVERHEAD_S))
    assert usual_move_seconds(make_plan(timing__move_s=2.5).settings) == 2.5


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


def test_without_a_point_out_of_reach_all_get_what_is_planned() -> None:
    assert shared_sizes(PLANNED, measured({}, set()), set()) == PLANNED
    assert shared_sizes(PLANNED, measured({1: 11, 2: 4}, {1}, 2), set()) == PLANNED


def test_the_others_share_what_a_point_does_not_get() -> None:
    found = shared_sizes(PLANNED, measured({1: 11, 2: 4}, {1}, 2), {5})
    assert found == PLANNED | {2: 14, 3: 14, 4: 14}
    assert shared_sizes(PLANNED, measured({1: 3, 2: 5}, {1}, 2), set())[2] == 13, "8 among 4"


def test_the_last_point_gets_what_is_left() -> None:
    state = measured({1: 11, 2: 14, 3: 14, 4: 9}, {1, 2, 3}, 4)
    assert shared_sizes(PLANNED, state, {5})[4] == 16
    assert shared_sizes(PLANNED, measured({1: 11}, {1, 2, 3, 4, 5}), set()) == PLANNED


def test_a_point_that_is_in_reach_again_gets_what_was_planned_for_it() -> None:
    state = measured({1: 11, 2: 14, 3: 14}, {1, 2, 3}, 4)
    assert shared_sizes(PLANNED, state, set()) == PLANNED
    assert shared_sizes(PLANNED, measured({1: 22}, {1}), set()) == PLANNED


def test_one_point_does_not_take_the_place_of_all() -> None:
    assert shared_sizes(PLANNED, measured({1: 4}, set(), 1), {2, 3, 4, 5})[1] == 22


@given(
    st.lists(st.integers(0, 20), min_size=5, max_size=5),
    st.sets(st.integers(1, 5)),
    st.sets(st.integers(1, 5)),
)
def test_no_point_gets_fewer_than_planned_and_all_together_no_more(
    counts: list[int], done: set[int], left: set[int]
) -> None:
    state = measured(dict(zip(PLANNED, counts, strict=True)), done)
    sizes = shared_sizes(PLANNED, state, left)
    waiting = set(PLANNED) - done - left
    assert all(PLANNED[point] <= sizes[point] <= MOST_SHARE * PLANNED[point] for point in PLANNED)
    asked = sum(sizes[point] for point in waiting)
    taken = sum(state.records_at(point) for point in set(PLANNED) - waiting)
    planned = sum(PLANNED[point] for point in waiting)
    assert asked == planned or asked + taken <= sum(PLANNED.values())
