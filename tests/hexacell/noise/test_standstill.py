"""Noise of readings at rest: what is drawn is found, and what is no noise is not taken for it."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from hexacell.noise.standstill import LARGEST_CORRELATION, USUAL_STEP_MM, display_step, reading_noise

READINGS = 40
SIGMA = 0.003
STEP = 1e-4
SERIES = 2000


def white(seed: int, sigma: float = SIGMA) -> np.ndarray:
    return sigma * np.random.default_rng(seed).standard_normal(READINGS)


def autoregressive(random: np.random.Generator, correlation: float, count: int) -> np.ndarray:
    """A stationary series of standard deviation ``SIGMA``."""
    draws = random.standard_normal(count)
    values = [draws[0]]
    for draw in draws[1:]:
        values.append(correlation * values[-1] + np.sqrt(1.0 - correlation**2) * draw)
    return SIGMA * np.array(values)


@pytest.fixture(scope="module")
def found():
    return [reading_noise(white(seed), STEP) for seed in range(SERIES)]


def test_the_variance_has_the_distribution_of_its_degrees_of_freedom(found) -> None:
    clean = [one for one in found if not one.outliers]
    assert {one.degrees_of_freedom for one in clean} == {READINGS - 2}
    scaled = np.array([one.degrees_of_freedom * (one.reading / SIGMA) ** 2 for one in clean])
    assert kstest(scaled, chi2(READINGS - 2).cdf).pvalue > 0.01


def test_white_noise_shows_no_drift_and_no_outlier_and_hardly_a_correlation(found) -> None:
    assert np.mean([one.drift != 0.0 for one in found]) < 0.004
    assert np.mean([one.outliers > 0 for one in found]) < 0.004
    assert np.mean([one.correlation > 0.0 for one in found]) < 0.02


@pytest.mark.parametrize("readings", [1, 7])
def test_stated_noise_is_rarely_exceeded_and_twice_as_much_nearly_always(found, readings) -> None:
    stated = SIGMA / np.sqrt(readings)
    assert np.mean([one.exceeds(stated, readings) for one in found]) < 0.006
    assert np.mean([one.exceeds(stated / 2.0, readings) for one in found]) > 0.99


def test_a_drift_is_found_and_is_not_in_the_noise() -> None:
    drift = np.linspace(0.0, 6.0 * SIGMA, READINGS)
    found = [reading_noise(white(seed) + drift, STEP) for seed in range(400)]
    assert np.mean([one.drift > 0.0 for one in found]) > 0.99
    assert np.mean([one.drift for one in found]) == pytest.approx(6.0 * SIGMA, rel=0.02)
    assert np.sqrt(np.mean([one.reading**2 for one in found])) == pytest.approx(SIGMA, rel=0.02)


@pytest.mark.parametrize("row", [0, 17, READINGS - 1])
def test_a_false_reading_is_left_out(row) -> None:
    values = white(3)
    clean = reading_noise(np.delete(values, row), STEP)
    values[row] += 12.0 * SIGMA
    found = reading_noise(values, STEP)
    assert found.outliers == 1
    assert found.degrees_of_freedom == READINGS - 3
    assert found.reading == pytest.approx(clean.reading, rel=0.03)
    assert found.drift == 0.0


def test_two_false_readings_do_not_hide_each_other() -> None:
    values = white(4)
    values[[10, 11]] += 10.0 * SIGMA
    assert reading_noise(values, STEP).outliers == 2


def test_a_dead_still_series_has_the_noise_of_its_display() -> None:
    found = reading_noise(np.full(READINGS, 12.345), 1e-3)
    assert found.reading == pytest.approx(1e-3 / np.sqrt(12.0))
    assert (found.drift, found.outliers, found.correlation) == (0.0, 0, 0.0)


def test_the_last_digit_that_flickers_once_is_no_false_reading() -> None:
    values = np.zeros(READINGS)
    values[20] = 1e-3
    assert reading_noise(values, 1e-3).outliers == 0


@pytest.mark.parametrize("correlation", [0.5, 0.8])
def test_the_mean_of_correlated_readings_is_as_noisy_as_drawn(correlation) -> None:
    """A series of 40 knows its correlation poorly: within 30 % of the truth on average, never sqrt(n)."""
    random = np.random.default_rng(5)
    found = [reading_noise(autoregressive(random, correlation, READINGS), STEP) for _ in range(1000)]
    means = [autoregressive(random, correlation, 7).mean() for _ in range(20_000)]
    stated = np.sqrt(np.mean([one.of_mean(7) ** 2 for one in found]))
    assert 0.7 * np.std(means) < stated < 1.1 * np.std(means)
    assert stated > 1.3 * SIGMA / np.sqrt(7.0)


def test_a_random_walk_has_the_largest_correlation() -> None:
    walk = np.cumsum(np.random.default_rng(6).standard_normal(400))
    assert reading_noise(walk, STEP).correlation == LARGEST_CORRELATION


@pytest.mark.parametrize(
    ("answers", "step"),
    [
        (["+1.234", "+1.235"], 1e-3),
        (["01A+00001.23"], 1e-2),
        (["-0.0005\r"], 1e-4),
        (["12"], USUAL_STEP_MM),
        ([], USUAL_STEP_MM),
    ],
)
def test_the_step_of_a_display_is_its_last_digit(answers, step) -> None:
    assert display_step(answers) == pytest.approx(step)
