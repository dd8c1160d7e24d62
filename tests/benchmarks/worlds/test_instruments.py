"""What gauges, stands and balls of a world show, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.benchmarks.worlds import encoders, gauges
from tests.benchmarks.worlds.effects import MOVE_GAUGES_HOURS, RECORD_HOURS, Effect, Stops, at_once
from tests.benchmarks.worlds.kinds import EVERY, KINDS, STATED_MM, turned

TWO_POINTS = np.repeat([0, 1], 20)
MOVED = np.random.default_rng(1).uniform(-3.0, 3.0, (40, 3))


def stops(seed: int = 1) -> Stops:
    joints = np.random.default_rng(seed).uniform(-400.0, 400.0, (40, 6))
    return Stops.of(TWO_POINTS, joints, 0.0, (seed,))


def test_a_turned_triad_shows_the_displacement_in_its_own_axes():
    vector = np.array([1e-3, -2e-3, 5e-4])
    seen = MOVED @ Rotation.from_rotvec(vector).as_matrix()  # R^T d for each row
    error = gauges.linear(turned(vector[None])).gauge_error(stops(), MOVED)
    assert np.allclose(MOVED + error, seen, atol=3 * 4e-6)


def test_a_ball_out_of_round_is_an_ellipsoid_to_first_order():
    size, axis, radius = 0.002, np.array([0.6, 0.0, 0.8]), 10.0
    rotations = Rotation.random(40, rng=np.random.default_rng(3)).as_matrix()
    cosine = rotations @ axis
    support = np.sqrt(((radius + size) * cosine) ** 2 + (radius - size / 2) ** 2 * (1 - cosine**2))
    found = gauges.out_of_round(size, axis, 2).ball(stops(), rotations)
    assert np.allclose(found, support - radius, atol=2e-6)


def test_the_third_order_of_roundness_changes_its_sign_with_the_side():
    ball = gauges.out_of_round(0.002, np.array([0.6, 0.0, 0.8]), 3)
    rotations = Rotation.random(40, rng=np.random.default_rng(3)).as_matrix()
    assert np.allclose(ball.ball(stops(), rotations), -ball.ball(stops(), -rotations))
    assert np.abs(ball.ball(stops(), rotations)).max() <= 0.002


def test_stands_drift_from_when_they_were_placed():
    speeds = np.array([[0.01, 0.0, 0.0], [0.0, 0.02, 0.0]])
    error = gauges.drifting(speeds).gauge_error(stops(), MOVED)
    minutes = RECORD_HOURS * np.arange(20)
    assert np.allclose(error[:20, 0], 0.01 * minutes)
    assert np.allclose(error[20:, 1], 0.02 * minutes)
    assert not error[20:, 0].any()


def test_a_stand_that_is_pushed_stays_there_until_the_gauges_are_moved():
    at = 7.5 * RECORD_HOURS
    error = gauges.jump(np.array([0.1, 0.2, 0.3]), at).gauge_error(stops(), MOVED)
    assert not error[:7].any()
    assert np.allclose(error[7:20], [0.1, 0.2, 0.3])
    assert not error[20:].any()


def test_time_passes_with_records_and_with_moving_the_gauges():
    hours = stops().hours
    assert hours[0] == pytest.approx(RECORD_HOURS)
    assert hours[-1] == pytest.approx(40 * RECORD_HOURS + MOVE_GAUGES_HOURS)


def test_backlash_is_on_the_side_that_a_slider_came_from():
    own = stops()
    error = encoders.hysteresis(0.002).encoder_error(own, own.joints)
    rising = np.diff(own.joints, axis=0) > 0
    assert np.array_equal(error[1:] > 0, rising)
    assert np.allclose(np.abs(error), 0.002)


def test_an_interpolation_error_repeats_after_its_period():
    own, phases = stops(), np.arange(6.0)
    error = encoders.periodic(0.001, 2.0, phases)
    assert np.allclose(
        error.encoder_error(own, own.joints), error.encoder_error(own, own.joints + 14.0), atol=1e-12
    )
    assert np.abs(error.encoder_error(own, own.joints)).max() == pytest.approx(0.001, rel=0.01)


@pytest.mark.parametrize("name", ["gauges noisier", "gauges noisier, long tails"])
def test_noise_is_as_many_times_the_stated_one(name):
    effect = KINDS[name].world(5.0, np.random.default_rng(1))  # 1 + 5 * 0.2 times the stated noise
    many = Stops.of(np.zeros(40_000, dtype=np.intp), np.zeros((40_000, 6)), 0.0, (1,))
    more = effect.gauge_error(many, np.zeros((40_000, 3)))
    assert np.hypot(np.std(more), STATED_MM) == pytest.approx(2.0 * STATED_MM, rel=0.05)


def test_a_hundredth_of_the_readings_are_outliers():
    many = Stops.of(np.zeros(40_000, dtype=np.intp), np.zeros((40_000, 6)), 0.0, (1,))
    assert np.mean(gauges.outliers(1.0).gauge_error(many, np.zeros((40_000, 3))) != 0) == pytest.approx(
        0.01, rel=0.1
    )
    hit = encoders.outliers(1.0).encoder_noise(many) != 0
    assert hit.any(axis=1).mean() == pytest.approx(0.01, rel=0.2)
    assert hit.sum(axis=1).max() == 1


def test_what_is_random_is_the_same_when_asked_twice_and_another_for_each_effect():
    noise = gauges.more_noise(EVERY)
    both = at_once(noise, noise).gauge_error(stops(), MOVED)
    assert np.array_equal(noise.gauge_error(stops(), MOVED), noise.gauge_error(stops(), MOVED))
    parts = [noise.gauge_error(stops().of_effect(number), MOVED) for number in (0, 1)]
    assert np.array_equal(both, parts[0] + parts[1])
    assert not np.array_equal(parts[0], parts[1])


def test_several_effects_are_random_if_one_is():
    assert at_once(Effect(), encoders.hysteresis(0.1)).is_random
    assert at_once(encoders.hysteresis(0.1), at_work=True).is_random
    assert not at_once(Effect(), gauges.stem_bends(0.1)).is_random


def test_readings_come_in_steps():
    read = MOVED + gauges.resolution(0.01).gauge_error(stops(), MOVED)
    assert np.allclose(read / 0.01, np.round(read / 0.01))
