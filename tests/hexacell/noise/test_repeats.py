"""Repeated readings correct the noise that is stated only where they contradict it."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.problem.prior import Noise
from hexacell.noise.allowances import ReferenceChange
from hexacell.noise.approach_scatter import RepeatedApproaches
from hexacell.noise.repeats import Repeats

NOISE = Noise(encoder=0.01, gauge_mm=0.01)


def repeats(ratio: float, random) -> Repeats:
    """Six visits more than the first and eight returns, of a machine this much noisier than stated."""
    approaches = RepeatedApproaches(visits=7, degrees_of_freedom=18, ball_mm=0.1, ratio=1.0)
    changes = [
        ReferenceChange(
            ratio * random.standard_normal(3), np.eye(3), np.zeros((3, 3)), np.zeros(3), np.zeros(6), 0.0
        )
        for _ in range(6 + 8)
    ]
    return Repeats.of(approaches, changes, NOISE)


def test_noise_as_stated_stays_as_it_is() -> None:
    random = np.random.default_rng(1)
    found = [repeats(1.0, random).applied_to(NOISE) for _ in range(500)]
    assert np.mean([one == NOISE for one in found]) > 0.99


@pytest.mark.sample("2.0")
@pytest.mark.parametrize("ratio", [2.0, 5.0])
def test_larger_noise_is_found_with_its_size_and_freedom(ratio) -> None:
    random = np.random.default_rng(2)
    found = [repeats(ratio, random).applied_to(NOISE) for _ in range(300)]
    assert np.mean([one.encoder for one in found]) == pytest.approx(0.01 * ratio, rel=0.05)
    assert np.mean([one.freedom == 18 + 8 * 3 for one in found]) > 0.98


@pytest.mark.sample("0.02")
@pytest.mark.parametrize("size", [0.02, 0.05])
def test_joints_that_stop_beside_what_encoders_show_are_told_from_noisy_readings(size) -> None:
    """They scatter along the directions in which the joints move the ball."""
    random = np.random.default_rng(3)
    found = []
    for _ in range(200):
        changes = []
        for _ in range(14):
            by_joints = 5.0 * random.standard_normal((3, 6)) * [[1.0], [0.2], [0.05]]
            stops = by_joints @ by_joints.T
            covariance = 1e-4 * (stops + np.eye(3))
            shown = random.multivariate_normal(np.zeros(3), covariance + size**2 * stops)
            changes.append(ReferenceChange(shown, covariance, stops, np.zeros(3), np.zeros(6), 0.0))
        found.append(Repeats(tuple(changes)))
    drawn = [one.unseen_stops(NOISE) for one in found]
    assert np.sqrt(np.mean([one.size**2 for one in drawn])) == pytest.approx(size, rel=0.05)
    spread = np.std([one.size**2 for one in drawn]) / size**2
    assert np.median([np.sqrt(2.0 / one.freedom) for one in drawn]) == pytest.approx(spread, rel=0.3)
    noise = [one.applied_to(NOISE) for one in found]
    assert np.mean([one.gauge_mm == pytest.approx(NOISE.gauge_mm) for one in noise]) > 0.8


def test_no_repeats_prove_nothing() -> None:
    """Where a reference was visited once, and no point was finished."""
    none = Repeats.of(None, (), NOISE)
    assert none.applied_to(NOISE) == NOISE
    assert none.unseen_stops(NOISE).size == 0.0


def test_repeats_as_stated_prove_no_stops() -> None:
    random = np.random.default_rng(4)
    assert np.mean([repeats(1.0, random).unseen_stops(NOISE).size == 0.0 for _ in range(300)]) > 0.95


def moved(random, walk_mm: float = 0.0, stops: float = 0.0, noise: float = 1.0, sets: int = 5) -> Repeats:
    """Six visits in short order, and the ends of sets, after 20 readings and 14."""
    changes = []
    for readings in (0,) * 6 + (20, 14, 14, 14, 14)[:sets]:
        by_joints = random.standard_normal((3, 6))
        square = by_joints @ by_joints.T
        covariance = 1e-4 * (square + np.eye(3))
        actual = noise**2 * covariance + stops**2 * square + readings * walk_mm**2 * np.eye(3)
        shown = random.multivariate_normal(np.zeros(3), actual)
        changes.append(ReferenceChange(shown, covariance, square, np.zeros(3), np.zeros(6), 0.0, readings))
    return Repeats(tuple(changes))


def drifting(repeats: Repeats, walk_mm: float) -> tuple[ReferenceChange, ...]:
    """Their changes, once that drift is known."""
    return tuple(replace(one, by_drift=one.readings * walk_mm**2 * np.eye(3)) for one in repeats.changes)


def test_gauges_that_drift_are_found_with_the_size_of_a_step_which_is_no_noise() -> None:
    random = np.random.default_rng(5)
    drawn = [moved(random, 0.03) for _ in range(200)]
    assert np.mean([one.show_drift(NOISE) for one in drawn]) > 0.9
    assert np.sqrt(np.mean([one.drift_mm**2 for one in drawn])) == pytest.approx(0.03, rel=0.05)
    known = [replace(one, is_measured=True, changes=drifting(one, 0.03)).applied_to(NOISE) for one in drawn]
    assert np.mean([noise.gauge_mm == NOISE.gauge_mm for noise in known]) > 0.98


@pytest.mark.parametrize("other", [{}, {"stops": 0.03}, {"noise": 3.0}, {"sets": 1, "walk_mm": 0.05}])
def test_other_scatter_and_one_set_that_does_not_close_are_no_drift(other) -> None:
    random = np.random.default_rng(6)
    assert np.mean([moved(random, **other).show_drift(NOISE) for _ in range(300)]) <= 0.01
