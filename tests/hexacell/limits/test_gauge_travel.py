"""The room of gauges on either side, by where their plungers stood when they were zeroed."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.mechanism import FrameTransform
from hexacell.limits.gauge_travel import GaugeRoom, GaugeTravel
from hexacell.limits.limits import Limits

TRAVEL = GaugeTravel(5.0, (6.25, 6.25, 6.25), (0.0, 0.0, 0.0), 1.0)


def test_a_gauge_zeroed_in_the_middle_or_not_at_all_has_the_same_room_on_both_sides() -> None:
    assert TRAVEL.room((0.0, 0.0, 0.0)) == TRAVEL.room() == GaugeRoom.symmetric(5.0)
    assert TRAVEL.sure_room == GaugeRoom.symmetric(4.0)


def test_a_gauge_zeroed_off_the_middle_has_less_on_that_side_and_no_more_on_the_other() -> None:
    room = TRAVEL.room((3.8, -0.5, 0.0))
    assert room.upper == pytest.approx((1.2, 5.0, 5.0))
    assert room.lower == pytest.approx((-5.0, -4.5, -5.0))
    assert room.smallest_mm == pytest.approx(1.2)
    # A short gauge has less than its plate allows.
    short = replace(TRAVEL, half_mm=(2.5, 6.25, 6.25)).room((1.0, 0.0, 0.0))
    assert (short.lower[0], short.upper[0]) == pytest.approx((-3.5, 1.5))
    # What a display shows in the middle counts.
    shifted = replace(TRAVEL, middle_mm=(6.25, 0.0, 0.0))
    assert shifted.room((7.25, 0.0, 0.0)).upper[0] == pytest.approx(4.0)
    assert shifted.places((7.25, 0.0, 0.0)) == (1.0, 0.0, 0.0)


def test_a_gauge_that_does_not_tell_its_place_may_stand_off_the_middle_to_both_sides() -> None:
    blind = replace(TRAVEL, middle_mm=(None, 0.0, 0.0))
    for zero in (None, (3.8, 0.0, 0.0)):
        room = blind.room(zero)
        assert (room.lower[0], room.upper[0]) == (-4.0, 4.0)
    assert blind.places((3.8, 0.0, 0.0))[0] is None


@pytest.mark.parametrize("place", [-1.0, -0.3, 0.7, 1.0])
def test_the_sure_room_is_part_of_that_of_every_station_mounted_well_enough(place: float) -> None:
    room, sure = TRAVEL.room((place, -place, place)), TRAVEL.sure_room
    assert np.all(np.array(room.lower) <= np.array(sure.lower))
    assert np.all(np.array(room.upper) >= np.array(sure.upper))


def test_the_sides_are_those_of_the_gauges_in_whatever_frames_the_robot_is_computed() -> None:
    half_a_turn = FrameTransform(np.diag([1.0, -1.0, -1.0]), np.zeros(3), np.eye(3))
    limits = Limits(5.0, 1.0, -800.0, 800.0, 0.03, half_a_turn, gauges=TRAVEL).zeroed_at((0.0, 4.0, 0.0))
    assert limits.within_travel(np.array([0.0, -0.9, 0.0]))
    assert not limits.within_travel(np.array([0.0, -1.1, 0.0]))
    assert limits.within_travel(np.array([0.0, 4.9, 0.0]))
