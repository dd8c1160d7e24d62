"""What a change is of, by all runs around it: a step, and the motion that began with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hexacell.drift.carried_posterior import CarriedPosterior
from hexacell.drift.change_attribution import AttributedChange, attributed_change
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

BEFORE, AFTER = 20, 40
NOTHING = CarriedPosterior.diffuse(6, 0)


def attributed(robot: LinearRobot, move: Callable[[int], None], nights: int = AFTER) -> AttributedChange:
    """Of a robot that is moved before the 21st night, the first of ``nights``, and before each after it."""
    runs = list(robot.runs(BEFORE))
    for number in range(nights):
        move(number)
        runs += robot.nights(1)
    days = np.arange(len(runs), dtype=float)
    return attributed_change(NOTHING, runs, days, BEFORE + 1, CAUSES)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_moves_on_by_nothing(seed) -> None:
    robot = LinearRobot(seed)

    def crash(number: int) -> None:
        robot.state[3] += 30.0 * (number == 0)

    found = attributed(robot, crash)
    assert (found.possible_legs, found.cause, found.moves_on) == ((2,), 3, False)
    assert abs(found.rate) < 4 * found.rate_sigma


@pytest.mark.parametrize("seed", range(3))
def test_a_drift_has_its_rate_and_the_longer_it_lasts_the_surer_is_its_leg(seed) -> None:
    robot = LinearRobot(seed)

    def drift(_: int) -> None:
        robot.state[1] += 0.05

    short, unmoved = attributed(robot, drift, 4), attributed(LinearRobot(seed), lambda _: None)
    assert not short.moves_on
    assert not unmoved.moves_on
    robot = LinearRobot(seed)
    found = attributed(robot, drift, 120)
    assert (found.possible_legs, found.cause, found.moves_on) == ((1,), 1, True)
    assert found.rate == pytest.approx(0.05, abs=4 * found.rate_sigma)
    assert len(found.possible_legs) <= len(short.possible_legs)


def test_the_likelihood_is_that_of_the_whole_problem_solved_at_once() -> None:
    """Step and rate of one cause, and all states, by one least-squares solution."""
    robot = LinearRobot(7)
    runs = list(robot.runs(BEFORE))
    robot.state[2] += 3.0
    runs += robot.nights(AFTER)
    days = np.arange(len(runs), dtype=float)
    found = attributed_change(NOTHING, runs, days, BEFORE + 1, CAUSES)
    information, weighted = np.diag([1e-4] * 6 + [1e-4, 0.01**-2]), np.zeros(8)
    for day, run in zip(days, runs, strict=True):
        later = max(day - days[BEFORE + 1], 0.0)
        row = np.eye(6, 8)
        row[found.cause, 6:] = (float(day > BEFORE), later)
        seen = run.in_terms_of(row)
        information, weighted = information + seen.information, weighted + seen.weighted
    solved, covariance = np.linalg.solve(information, weighted), np.linalg.inv(information)
    np.testing.assert_allclose((found.change, found.rate), solved[6:], rtol=1e-6)
    np.testing.assert_allclose((found.sigma, found.rate_sigma), np.sqrt(np.diag(covariance)[6:]), rtol=1e-6)
