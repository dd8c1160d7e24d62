"""What measuring costs, and what a budget still allows."""

from __future__ import annotations

import math

import pytest

from hexacell.campaign.budget import MOVE_OVERHEAD_S, Budget, TimeModel, usual_move_seconds


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
