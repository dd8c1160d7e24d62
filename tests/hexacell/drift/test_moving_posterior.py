"""What is known of a robot some legs of which may move on: nothing false, and more with each run."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.drift.moving_posterior import USUAL_RATE, MovingPosterior
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

DAYS = (0.0, 1.0, 2.5, 4.0, 7.0)


def known_after(robot: LinearRobot, *, moving: tuple[int, ...] = ()) -> MovingPosterior:
    """By some runs, before which some legs may have moved, and may move on."""
    known = MovingPosterior.of_unmoved(CAUSES, 0.0).forgetting_legs(moving)
    for day, run in zip(DAYS, robot.nights(len(DAYS)), strict=True):
        known = known.after(run, day)
    return known


def test_the_state_of_a_later_day_is_that_of_before_and_its_motion() -> None:
    robot = LinearRobot()
    known = known_after(robot, moving=(2,))
    later = known.on(10.0)
    rates = known.posterior.state[6:]
    moved = known.posterior.state[:6] + 10.0 * CAUSES.by_state[list(known.moving)].T @ rates
    np.testing.assert_allclose(later.posterior.state, [*moved, *rates], atol=1e-6)
    run = next(robot.nights(1))
    first, second = (one.posterior.scores(one.seen(run, 12.0), one.by_state) for one in (known, later))
    np.testing.assert_allclose(first, second, rtol=1e-6)


def test_of_a_forgotten_leg_nothing_is_known_and_of_the_others_what_was() -> None:
    known = known_after(LinearRobot())
    forgotten = known.forgetting_legs((2,))
    assert [int(CAUSES.legs[index]) for index in forgotten.moving] == [2, 2]
    sigma = np.sqrt(np.diag(np.linalg.inv(forgotten.posterior.evidence.information)))
    was = np.sqrt(np.diag(np.linalg.inv(known.posterior.evidence.information)))
    np.testing.assert_allclose(sigma[[2, 3]], 100.0, rtol=0.01)
    np.testing.assert_allclose(sigma[[0, 1, 4, 5]], was[[0, 1, 4, 5]], rtol=1e-3)
    np.testing.assert_allclose(sigma[6:], USUAL_RATE)


def test_a_leg_is_still_again_once_the_runs_say_so_and_not_before() -> None:
    robot = LinearRobot(3)
    known = known_after(robot, moving=(2,))
    assert known.still_legs == ()
    for day in range(8, 4000, 40):
        for run in robot.nights(1):
            known = known.after(run, float(day))
    assert known.still_legs == (2,)
    still = known.standing_still((2,))
    assert still.moving == ()
    assert len(still.posterior.state) == 6


@pytest.mark.parametrize("rate", [0.002, -0.01])
def test_a_leg_that_moves_on_is_never_still(rate) -> None:
    robot = LinearRobot(4)
    known = known_after(robot, moving=(2, 3))
    for day in range(8, 4000, 40):
        robot.state[3] += 40.0 * rate
        for run in robot.nights(1):
            known = known.after(run, float(day))
        assert 2 not in known.still_legs
    assert known.still_legs == (3,)
    place = 6 + known.moving.index(3)
    assert known.posterior.state[place] == pytest.approx(rate, abs=5e-4)


def test_what_is_said_of_rates_can_be_left_away() -> None:
    known = known_after(LinearRobot(), moving=(1, 3))
    assert {int(CAUSES.legs[index]) for index in known.without_rates((1,)).moving} == {3}
    assert known.without_rates(()).moving == known.moving
