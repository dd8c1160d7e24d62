"""Rates by all runs: right, with the right sigma, and none where nothing tells."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.drift.carried_posterior import CarriedPosterior
from hexacell.drift.steady_drift import SteadyDrift, steady_drift
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

DAYS = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 30.0])
DIFFUSE = CarriedPosterior.diffuse(6, 0)


def drifted(seed: int, per_day: float) -> SteadyDrift:
    """Of a robot whose third parameter drifts."""
    robot = LinearRobot(seed)
    start, runs = robot.state.copy(), []
    for day in DAYS:
        robot.state = start + day * per_day * np.eye(6)[2]
        rows = robot.calibration if day == 0.0 else robot.check
        runs.append(robot.records(rows, robot.state).evidence)
    return steady_drift(DIFFUSE, runs, DAYS, CAUSES.by_state)


def test_the_rate_of_one_cause_is_found_with_its_sigma() -> None:
    found = [drifted(seed, 0.3) for seed in range(300)]
    errors = [(one.rates[2] - 0.3) / one.sigmas[2] for one in found]
    assert np.mean(errors) == pytest.approx(0.0, abs=0.2)
    assert np.std(errors) == pytest.approx(1.0, abs=0.15)
    assert np.mean([np.abs(one.scores).argmax() == 2 for one in found]) > 0.9


def test_without_drift_the_limit_is_exceeded_as_seldom_as_stated() -> None:
    found = [drifted(seed, 0.0) for seed in range(400)]
    scores = np.array([one.scores for one in found])
    assert np.abs(scores.std(axis=0) - 1.0).max() < 0.15
    assert sum(np.abs(one.scores).max() > one.limit for one in found) <= 4 + 4 * 2
    assert 3.0 < found[0].limit < 3.2


def test_more_runs_make_it_surer() -> None:
    runs = list(LinearRobot(1).runs(40))
    few, many = (steady_drift(DIFFUSE, runs[:n], np.arange(float(n)), CAUSES.by_state) for n in (10, 40))
    assert (many.sigmas < 0.2 * few.sigmas).all()


@pytest.mark.parametrize("days", [[1.0], [1.0, 1.0, 1.0]])
def test_one_instant_tells_no_rate(days) -> None:
    runs = list(LinearRobot(1).runs(len(days)))[: len(days)]
    found = steady_drift(DIFFUSE, runs, np.array(days), CAUSES.by_state)
    assert np.isinf(found.sigmas).all()
    assert not found.scores.any()
