"""Where the simulated gauges go: to the ball by hand, and from seat to seat of a fixture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drivers.simulated.physics import GaugePlaces
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.simulation import SimulatedFixture
from hexacell.cell.uncertainty import LengthCheckSettings

FIXTURE = LengthCheckSettings(
    first_seat=(-150.0, 0.0, 500.0), direction=(0.6, 0.8, 0.0), distance_mm=200.0, uncertainty_mm=0.01
)
FIRST, SECOND = np.array(FIXTURE.first_seat), np.array(FIXTURE.second_seat)
ELSEWHERE = np.array([100.0, -100.0, 550.0])


@pytest.fixture
def places():
    simulation = load_cell(bundled_config("simulated-hexaglide")).settings.simulation
    assert simulation is not None

    def make(
        ball: Any = FIRST, *, has_fixture: bool = True, off_mm: Any = (0.0, 0.0, 0.0), **fixture: float
    ) -> GaugePlaces:
        settings = simulation.model_copy(
            update={
                "fixture": SimulatedFixture(**fixture),
                "gauges": simulation.gauges.model_copy(
                    update={"misalignment_deg": 1.0, "off_middle_mm": off_mm}
                ),
            }
        )
        return GaugePlaces(settings, FIXTURE if has_fixture else None, np.random.default_rng(3), ball)

    return make


def test_plungers_stand_off_their_middle_by_what_the_cell_file_says(places) -> None:
    right, off = places(ELSEWHERE), places(ELSEWHERE, off_mm=(3.8, -1.0, 0.5))
    shown = off.triad @ (ELSEWHERE - off.station) - right.triad @ (ELSEWHERE - right.station)
    assert shown == pytest.approx([3.8, -1.0, 0.5])


def test_between_the_seats_the_gauges_keep_the_certified_distance(places) -> None:
    made = places()
    first, triad = made.station, made.triad
    assert 0.05 < np.linalg.norm(first - FIRST) < 2.0
    made.follow(SECOND + 1.0)
    assert made.station - first == pytest.approx(SECOND - FIRST)
    assert made.triad == pytest.approx(triad)
    made.follow(FIRST - 1.0)
    assert made.station == pytest.approx(first)


def test_a_fixture_has_the_distance_the_direction_and_the_seating_that_are_stated(places) -> None:
    made = places(distance_mm=200.5, yaw_deg=90.0)
    first = made.station
    made.follow(SECOND)
    assert made.station - first == pytest.approx([-160.4, 120.3, 0.0])
    loose = places(seating_mm=0.01)
    first = loose.station
    loose.follow(SECOND)
    loose.follow(FIRST)
    assert 0.001 < np.linalg.norm(loose.station - first) < 0.05


def test_gauges_that_are_turned_in_the_second_seat_see_the_ball_from_there(places) -> None:
    made = places(turned_deg=180.0)
    ball = made.triad.T @ [1.0, 2.0, 3.0]
    made.follow(SECOND)
    assert made.triad @ ball == pytest.approx([-1.0, -2.0, 3.0])


@pytest.mark.parametrize("has_fixture", [True, False])
def test_everywhere_else_they_are_placed_by_hand(places, has_fixture: bool) -> None:
    made = places(ELSEWHERE, has_fixture=has_fixture)
    made.follow(SECOND)
    off = made.station - SECOND
    assert 0.05 < np.linalg.norm(off) < 2.0
    before = made.triad
    made.follow(FIRST)
    assert not np.allclose(made.station - FIRST, off)
    assert not np.allclose(made.triad, before)


def test_a_ball_that_stays_near_does_not_move_them(places) -> None:
    made = places()
    before = made.station
    made.follow(FIRST + 5.0)
    assert made.station is before
