"""The test of single causes: as many false alarms as stated, and what it finds."""

import numpy as np
import pytest

from hexacell.drift.run_evidence import WhitenedRecords
from hexacell.drift.single_cause import SingleCauseTest, single_cause_test
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

COVARIANCE = 0.3 * np.eye(6)


def outcome(seed: int, change: np.ndarray | None = None, records: int = 9) -> SingleCauseTest:
    """Of a robot that is known with a covariance, and has changed since."""
    robot = LinearRobot(seed)
    state = robot.random.normal(0.0, np.sqrt(0.3), 6) + (0.0 if change is None else change)
    return single_cause_test(robot.records(robot.check[:records], state), COVARIANCE, CAUSES.by_state)


def test_scores_are_standard_normal() -> None:
    scores = np.array([outcome(seed).scores for seed in range(100)])
    assert np.abs(scores.mean(axis=0)).max() < 0.3
    assert np.abs(scores.std(axis=0) - 1.0).max() < 0.22


def test_a_change_is_estimated_with_its_sigma() -> None:
    change = np.array([0.0, 0.0, 0.0, 6.0, 0.0, 0.0])
    found = [outcome(seed, change) for seed in range(100)]
    errors = [(one.changes[3] - 6.0) / one.sigmas[3] for one in found]
    assert np.mean(errors) == pytest.approx(0.0, abs=0.33)
    assert np.std(errors) == pytest.approx(1.0, abs=0.25)
    assert np.mean([one.likeliest == 3 for one in found]) > 0.9


def test_a_cause_that_is_not_seen_is_never_blamed() -> None:
    rows = np.random.default_rng(1).standard_normal((9, 6))
    rows[:, 2] = 0.0
    found = single_cause_test(WhitenedRecords(np.zeros(6), rows, np.full(9, 30.0)), COVARIANCE, np.eye(6))
    assert (found.scores[2], np.isinf(found.sigmas[2])) == (0.0, True)
    assert found.is_alarm


def test_correlated_scores_need_a_lower_limit_than_independent_ones() -> None:
    rows = np.random.default_rng(2).standard_normal((9, 6))
    records = WhitenedRecords(np.zeros(6), rows, np.zeros(9))
    one = single_cause_test(records, COVARIANCE, np.eye(6)[:1]).limit
    same = single_cause_test(records, COVARIANCE, np.repeat(np.eye(6)[:1], 5, axis=0)).limit
    six = single_cause_test(records, COVARIANCE, np.eye(6)).limit
    assert one == pytest.approx(2.576, abs=0.03)
    assert same == pytest.approx(one, abs=0.03)
    assert one < six < 3.2
