"""Single causes and located steps, against searches of all splits and least squares."""

import numpy as np
import pytest
import ruptures

from hexacell.drift.run_evidence import CarriedPosterior, RunEvidence, WhitenedRecords, step_gains
from hexacell.drift.single_cause import SingleCauseTest, single_cause_test
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

COVARIANCE = 0.3 * np.eye(6)


def outcome(seed: int, change: np.ndarray | None = None, records: int = 9) -> SingleCauseTest:
    """Of a robot that is known with a covariance, and has changed since."""
    robot = LinearRobot(seed)
    state = robot.random.normal(0.0, np.sqrt(0.3), 6) + (0.0 if change is None else change)
    return single_cause_test(robot.records(robot.check[:records], state), COVARIANCE, CAUSES.by_state)


def test_scores_are_standard_normal_and_a_change_is_estimated_with_its_sigma() -> None:
    scores = np.array([outcome(seed).scores for seed in range(100)])
    assert np.abs(scores.mean(axis=0)).max() < 0.3
    assert np.abs(scores.std(axis=0) - 1.0).max() < 0.22
    change = np.array([0.0, 0.0, 0.0, 6.0, 0.0, 0.0])
    found = [outcome(seed, change) for seed in range(100)]
    errors = [(one.changes[3] - 6.0) / one.sigmas[3] for one in found]
    assert np.mean(errors) == pytest.approx(0.0, abs=0.33)
    assert np.std(errors) == pytest.approx(1.0, abs=0.25)
    assert np.mean([np.abs(one.scores).argmax() == 3 for one in found]) > 0.9


def test_a_cause_that_is_not_seen_is_never_blamed() -> None:
    rows = np.random.default_rng(1).standard_normal((9, 6))
    rows[:, 2] = 0.0
    found = single_cause_test(WhitenedRecords(np.zeros(6), rows, np.full(9, 30.0)), COVARIANCE, np.eye(6))
    assert (found.scores[2], np.isinf(found.sigmas[2])) == (0.0, True)
    assert np.abs(found.scores).max() > found.limit


def test_correlated_scores_need_a_lower_limit_than_independent_ones() -> None:
    rows = np.random.default_rng(2).standard_normal((9, 6))
    records = WhitenedRecords(np.zeros(6), rows, np.zeros(9))
    one = single_cause_test(records, COVARIANCE, np.eye(6)[:1]).limit
    same = single_cause_test(records, COVARIANCE, np.repeat(np.eye(6)[:1], 5, axis=0)).limit
    six = single_cause_test(records, COVARIANCE, np.eye(6)).limit
    assert one == pytest.approx(2.576, abs=0.03)
    assert same == pytest.approx(one, abs=0.03)
    assert one < six < 3.2


DIFFUSE = CarriedPosterior.diffuse(6, 0)


@pytest.mark.parametrize("seed", range(6))
def test_the_time_is_that_of_least_squares(seed) -> None:
    """One parameter, seen alike by every run: the likeliest step is the best split into two means."""
    random = np.random.default_rng(seed)
    values = random.standard_normal(40)
    values[int(random.integers(5, 35)) :] += 1.0
    runs = [RunEvidence(np.ones((1, 1)), np.array([value])) for value in values]
    gains = step_gains(CarriedPosterior.diffuse(1, 0), runs, np.ones((1, 1)))
    split, _ = ruptures.Dynp(model="l2", min_size=1, jump=1).fit(values).predict(n_bkps=1)
    assert divmod(int(gains.gains.argmax()), gains.gains.shape[1]) == (split, 0)
    before, after = values[:split], values[split:]
    assert gains.changes[split, 0] == pytest.approx(after.mean() - before.mean(), rel=1e-3)
    assert gains.sigmas[split, 0] == pytest.approx(np.sqrt(1 / len(before) + 1 / len(after)), rel=1e-3)


def test_size_and_sigma_are_those_of_a_fit_with_the_step() -> None:
    robot = LinearRobot(1)
    runs = list(robot.runs(9))
    robot.state[2] += 1.5
    runs += robot.nights(7)
    gains = step_gains(DIFFUSE, runs, CAUSES.by_state)
    normal, weighted = np.zeros((7, 7)), np.zeros(7)
    normal[:6, :6] += DIFFUSE.information
    for place, run in enumerate(runs):
        to_state = np.column_stack([np.eye(6), CAUSES.by_state[2] if place >= 10 else np.zeros(6)])
        normal += to_state.T @ run.information @ to_state
        weighted += to_state.T @ run.weighted
    covariance = np.linalg.inv(normal)
    assert gains.changes[10, 2] == pytest.approx((covariance @ weighted)[6], rel=1e-6)
    assert gains.sigmas[10, 2] == pytest.approx(np.sqrt(covariance[6, 6]), rel=1e-6)


def test_a_large_step_leaves_no_doubt_of_its_time() -> None:
    robot = LinearRobot(2)
    runs = list(robot.runs(9))
    robot.state[4] += 8.0
    runs += robot.nights(3)
    gains = step_gains(DIFFUSE, runs, CAUSES.by_state)
    assert divmod(int(gains.gains.argmax()), gains.gains.shape[1]) == (10, 4)
    assert gains.likely_runs(4) == (10, 10)
    assert gains.changes[10, 4] == pytest.approx(8.0, abs=4 * gains.sigmas[10, 4])


def test_a_step_before_the_first_run_is_not_seen() -> None:
    gains = step_gains(DIFFUSE, list(LinearRobot().runs(5)), CAUSES.by_state)
    assert not gains.gains[0].any()
    assert np.isinf(gains.sigmas[0]).all()
