"""What measuring costs, what a budget still allows, and how records are shared among points."""

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
    """Minutes are those after points of 5 minutes, and after references that are read again."""
    budget = Budget(most_records, most_minutes, TimeModel(5.0, 30.0))
    assert budget.records_left(records, stations) == left


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
