"""Innovations of an unchanged robot are standard normal and independent; estimates by night are not."""

import numpy as np
import pytest

from hexacell.drift.run_evidence import DIFFUSE, CarriedPosterior, RunEvidence
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

ROBOTS = 400
NIGHTS = 12


@pytest.fixture(scope="module")
def scores() -> np.ndarray:
    """Of many unchanged robots: (robots, nights, causes)."""
    found: list[list[np.ndarray]] = []
    for seed in range(ROBOTS):
        posterior = CarriedPosterior.diffuse(6, 0)
        calibration, *nights = LinearRobot(seed).runs(NIGHTS)
        posterior = posterior.after(calibration)
        found.append([])
        for night in nights:
            found[-1].append(posterior.scores(night, CAUSES.by_state))
            posterior = posterior.after(night)
    return np.array(found)


def test_they_are_standard_normal_and_independent_of_those_before(scores) -> None:
    assert np.abs(scores.mean(axis=0)).max() < 4.0 / np.sqrt(ROBOTS)
    assert np.abs(scores.std(axis=0) - 1.0).max() < 4.0 / np.sqrt(2 * ROBOTS)
    products = np.einsum("rni,rmi->nm", scores, scores) / (ROBOTS * scores.shape[2])
    np.fill_diagonal(products, 0.0)
    assert np.abs(products).max() < 4.5 / np.sqrt(ROBOTS)


def test_before_a_calibration_nothing_is_said() -> None:
    night = next(LinearRobot().nights(1))
    assert np.isnan(CarriedPosterior.diffuse(6, 0).scores(night, CAUSES.by_state)).all()


def test_forgetting_a_cause_is_a_wide_prior_along_it() -> None:
    posterior = CarriedPosterior.diffuse(6, 0).after(next(LinearRobot().runs(0)))
    cause = np.array([1.0, 0.5, 0.0, 0.0, -1.0, 0.0])
    forgot = posterior.forgetting(cause[None])
    covariance = np.linalg.inv(posterior.information)
    np.testing.assert_allclose(forgot.state, posterior.state, atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.inv(forgot.information), covariance + DIFFUSE**2 * np.outer(cause, cause), rtol=1e-6
    )


def test_shared_causes_cancel_between_runs() -> None:
    """What is the same in all runs is no change, however large; unknown to the watch it would be one."""
    random = np.random.default_rng(0)
    causes = np.concatenate([np.eye(6), np.zeros((6, 2))], axis=1)
    rows = random.standard_normal((2, 30, 8))
    state = np.concatenate([np.zeros(6), [3.0, -3.0]])

    def evidence(part: np.ndarray, columns: int):
        values = part @ state + random.standard_normal(30)
        known = part[:, :columns]
        return RunEvidence(known.T @ known, known.T @ values)

    aware = CarriedPosterior.diffuse(6, 2).after(evidence(rows[0], 8))
    unaware = CarriedPosterior.diffuse(6, 0).after(evidence(rows[0], 6))
    assert np.abs(aware.scores(evidence(rows[1], 8), causes)).max() < 3.5
    assert np.abs(unaware.scores(evidence(rows[1], 6), np.eye(6))).max() > 4.5
