"""U is the quantile of the distributions that have a closed form, and the same each time."""

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from hexacell.uncertainty.statement import LargestError, TaskErrors


def errors(estimated, effects):
    return TaskErrors(np.asarray(estimated, dtype=float), np.asarray(effects, dtype=float))


def isotropic(sigma: float) -> np.ndarray:
    effects = np.zeros((1, 6, 3))
    effects[0, :3] = sigma * np.eye(3)
    return effects


def test_without_effects_nothing_is_uncertain_and_one_pose_has_the_quantile_of_its_distribution() -> None:
    stated = errors([[3.0, 4.0, 0.0, 0.0, 0.0, np.radians(2.0)]], np.zeros((1, 6, 0)))
    assert stated.position == LargestError(5.0, 0.0)
    assert stated.orientation.value == pytest.approx(2.0)
    position = errors(np.zeros((1, 6)), isotropic(0.02)).position
    assert position.value == 0.0
    assert position.expanded == pytest.approx(0.02 * np.sqrt(chi2.ppf(0.95, 3)), rel=0.02)
    stated = errors([[1.0, 2.0, 2.0, 0.0, 0.0, 0.0]], isotropic(0.5)).position
    low, high = (stated.value + sign * stated.expanded for sign in (-1.0, 1.0))
    inside = [ncx2.cdf((edge / 0.5) ** 2, 3, (3.0 / 0.5) ** 2) for edge in (low, high)]
    assert inside[1] - inside[0] == pytest.approx(0.95, abs=0.006)


def test_the_largest_of_independent_poses_is_more_uncertain_than_each() -> None:
    effects = np.zeros((2, 6, 2))
    effects[0, 0, 0] = effects[1, 0, 1] = 1.0
    both = errors(np.zeros((2, 6)), effects).position.expanded
    # P(max of two |z| <= q) = P(|z| <= q)^2.
    assert both == pytest.approx(np.sqrt(chi2.ppf(np.sqrt(0.95), 1)), rel=0.02)


def test_a_covariance_and_the_same_effects_give_the_same_statement() -> None:
    random = np.random.default_rng(3)
    jacobian, factor = random.standard_normal((4, 6, 5)), random.standard_normal((5, 5))
    difference = random.standard_normal(5)
    by_covariance = TaskErrors.of(jacobian, difference, factor @ factor.T, np.zeros((4, 6, 0)))
    by_effects = TaskErrors.of(jacobian, difference, np.zeros((5, 5)), jacobian @ factor)
    assert by_covariance.position.value == pytest.approx(by_effects.position.value)
    assert by_covariance.position.expanded == pytest.approx(by_effects.position.expanded, rel=0.03)
    assert by_covariance.worst == by_effects.worst
