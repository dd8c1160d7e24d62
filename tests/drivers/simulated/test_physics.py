"""The true state of the simulated robot: motions, positions, sensors with noise, places of the gauges."""

from typing import Any

import numpy as np
import pytest

from drivers.simulated.physics import GaugePlaces, Motion
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.simulation import SimulatedFixture
from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.errors import ReachError
from hexacell.kinematics.pose import Pose

# Away from the first point, and back, and tilted: nothing special.
POSES = [
    Pose(10.0, -5.0, 545.0),
    Pose(0.0, 0.0, 550.0, 8.0, -6.0, 4.0),
    Pose(-12.0, 8.0, 560.0, -10.0, 3.0, -5.0),
    Pose(0.0, 0.0, 550.0),
]


def there_and_back(twin: Any, start: Any) -> None:
    for path in ([start, start + 1.0], [start + 1.0, start]):
        twin.physics.start_motion(np.stack(path))
        twin.clock.time_s += 10.0


def test_the_ball_is_where_the_true_geometry_puts_it(make_twin) -> None:
    twin = make_twin(station_reach_mm=1e6)
    reference, seen = twin.ball_at(Pose(0.0, 0.0, 550.0)), twin.seen()
    for pose in POSES:
        twin.go(pose)
        assert twin.seen() - seen == pytest.approx(twin.ball_at(pose) - reference, abs=1e-6)


def test_a_move_takes_the_time_of_its_longest_slider(make_twin) -> None:
    twin = make_twin(motion__speed_mm_s=50.0, motion__minimum_s=0.2)
    here = twin.physics.encoder_positions()
    motion = twin.physics.start_motion(np.stack([here, here + np.array([0.0, 0.0, -30.0, 0.0, 0.0, 10.0])]))
    assert motion.duration_s == pytest.approx(0.6)
    twin.clock.time_s += 10.0
    here = twin.physics.encoder_positions()
    assert twin.physics.start_motion(np.stack([here, here + 0.001])).duration_s == 0.2


def test_noise_is_drawn_at_every_stop_and_stays_until_the_next(make_twin) -> None:
    twin = make_twin(gauges__noise_mm=0.01, encoders__noise_mm=0.01, station_reach_mm=1e6)
    gauges, sliders = [], []
    start = twin.physics._motion.path[0]
    for _ in range(60):
        there_and_back(twin, start)
        seen = twin.seen()
        assert np.array_equal(twin.seen(), seen)
        assert np.array_equal(twin.physics.encoder_positions(), twin.physics.encoder_positions())
        gauges.append(seen)
        sliders.append(twin.physics.encoder_positions() - start)
    for scatter in (np.array(gauges) - np.mean(gauges, axis=0), np.array(sliders)):
        # 180 and 360 numbers: their standard deviation is known to 5 %.
        assert np.std(scatter) == pytest.approx(0.01, rel=0.25)
        assert np.all(np.std(scatter, axis=0) > 0.004)


def test_flicker_is_drawn_at_every_reading(make_twin) -> None:
    twin = make_twin(gauges__flicker_mm=0.002, encoders__flicker_mm=0.002)
    gauges = np.array([twin.seen() for _ in range(60)])
    sliders = np.array([twin.physics.encoder_positions() for _ in range(60)])
    for readings in (gauges, sliders):
        assert np.std(readings - readings.mean(axis=0)) == pytest.approx(0.002, rel=0.25)


def test_the_ball_oscillates_on_arrival_and_the_oscillation_decays(make_twin) -> None:
    twin = make_twin(motion__ringing_mm=0.2, motion__ringing_s=0.15)
    quiet = make_twin()
    for each in (twin, quiet):
        each.machine.move(POSES[0])
    offset = np.linalg.norm(twin.seen() - quiet.seen() - _placing(twin, quiet))
    assert offset == pytest.approx(0.2, abs=1e-9)
    swings = []
    for _ in range(200):
        twin.clock.time_s += 0.01
        quiet.clock.time_s += 0.01
        swings.append(np.linalg.norm(twin.seen() - quiet.seen() - _placing(twin, quiet)))
    envelope = 0.2 * np.exp(-0.01 * np.arange(1, 201) / 0.15)
    assert np.all(np.array(swings) <= envelope + 1e-9)
    assert max(swings[:10]) > 0.1
    assert swings[-1] < 1e-5


def _placing(one: Any, other: Any) -> Any:
    return other.physics.gauges.station - one.physics.gauges.station


def test_encoders_that_are_long_show_what_is_commanded_and_the_sliders_move_less(make_twin) -> None:
    twin = make_twin(encoders__common_scale_um_m=1000.0)
    twin.machine.move(POSES[0])
    shown = twin.joints_for(POSES[0])
    assert twin.physics.encoder_positions() == pytest.approx(shown, abs=1e-9)
    true = make_twin()
    true.machine.move(POSES[0])
    closed = true.physics.encoder_positions()
    assert closed == pytest.approx(shown, abs=1e-9)
    assert twin.physics._motion.joints(twin.clock.now()) == pytest.approx(shown / 1.001, abs=1e-9)


def test_slider_stops_scatter_by_the_repeatability(make_twin) -> None:
    stops = scattered_stops(make_twin(motion__repeatability_mm=0.5, station_reach_mm=1e6))
    assert np.std(stops) == pytest.approx(0.5, rel=0.25)


def test_the_scatter_of_a_machine_that_wears_grows_with_every_move(make_twin) -> None:
    twin = make_twin(motion__repeatability_mm=0.05, motion__growth_per_move=0.02, station_reach_mm=1e6)
    first, last = np.split(np.abs(scattered_stops(twin)), 2)
    assert last.mean() > 2.0 * first.mean()


def scattered_stops(twin) -> np.ndarray:
    """How far joints stop beside their command, at 40 stops."""
    start = twin.physics.encoder_positions()
    stops = []
    for _ in range(40):
        there_and_back(twin, start)
        stops.append(twin.physics.encoder_positions() - start)
    return np.array(stops)


def test_gauges_do_not_move_while_the_robot_moves(make_twin) -> None:
    twin = make_twin(station_reach_mm=30.0)
    before = twin.seen()
    start = twin.physics.encoder_positions()
    motion = twin.physics.start_motion(np.stack([start, start + 50.0, start]))
    twin.clock.time_s += motion.duration_s / 2.0
    assert twin.seen() - before == pytest.approx([50.0, 0.0, 0.0], abs=1e-6)
    twin.clock.time_s += motion.duration_s
    assert twin.seen() == pytest.approx(before, abs=1e-6)


def test_a_start_out_of_reach_of_the_true_geometry_is_refused(make_twin, bundled_cell) -> None:
    truth = bundled_cell.settings.simulation.geometry.model_dump()
    short = [length / 3.0 for length in truth["l"]]
    with pytest.raises(ReachError, match=r"cannot reach X0\.000"):
        make_twin(geometry__l=short)


def test_the_pose_is_found_again_after_slider_positions_without_a_pose(make_twin) -> None:
    """At positions that no pose closes the platform waits; back in reach everything is as before."""
    twin = make_twin(station_reach_mm=1e6)
    start, seen = twin.physics.encoder_positions(), twin.seen()
    apart = start + np.repeat([-400.0, 400.0], 3)
    motion = twin.physics.start_motion(np.linspace(start, apart, 25))
    twin.clock.time_s += motion.duration_s + 1.0
    assert np.isfinite(twin.seen()).all()
    motion = twin.physics.start_motion(np.linspace(apart, start, 25))
    twin.clock.time_s += motion.duration_s + 1.0
    assert twin.seen() == pytest.approx(seen, abs=1e-6)


PATH = np.array([[0.0] * 6, [1.0] * 6, [3.0, 2.0, 2.0, 2.0, 2.0, 2.0]])


@pytest.fixture
def motion() -> Motion:
    return Motion(PATH, start_s=10.0, duration_s=4.0)


@pytest.mark.parametrize(
    ("now_s", "fraction"),
    [
        (0.0, 0.0),
        (10.0, 0.0),
        (12.0, 0.5),
        (14.0, 1.0),
        (99.0, 1.0),
        (10.1, 0.05 / (2.0 * 3.8)),
        (11.0, 0.9 / 3.8),
    ],
)
def test_fraction_of_the_path(motion: Motion, now_s: float, fraction: float) -> None:
    assert motion.fraction(now_s) == pytest.approx(fraction)
    assert motion.path_position(now_s) == pytest.approx(2.0 * fraction)


def test_a_motion_is_linear_between_rows_of_the_path(motion: Motion) -> None:
    place = motion.path_position(13.0)
    assert 1.0 < place < 2.0
    expected = PATH[1] + (place - 1.0) * (PATH[2] - PATH[1])
    assert motion.joints(13.0) == pytest.approx(expected)


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
