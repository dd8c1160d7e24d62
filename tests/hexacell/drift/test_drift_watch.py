"""The watch: quiet on an unchanged robot, and what it says of one that changed."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.drift.drift_watch import DriftWatch, StepAlarm, watch_runs
from hexacell.drift.single_cause import possible_groups
from tests.hexacell.drift.synthetic_runs import CAUSES, LEGS, LinearRobot


def test_unchanged_robots_raise_no_alarm() -> None:
    found = [watch_runs(LinearRobot(seed).runs(60), CAUSES) for seed in range(4)]
    assert [changes for changes, _ in found] == [()] * 4
    assert all(0.0 < shares.max() < 1.0 for _, shares in found)


def crashed(*changes: tuple[int, float], seed: int = 0) -> tuple[StepAlarm, ...]:
    """The alarms of a robot that changes after 30 nights, and again 30 nights later."""
    robot = LinearRobot(seed)
    runs = list(robot.runs(30))
    for parameter, size in changes:
        robot.state[parameter] += size
        runs += robot.nights(30)
    return watch_runs(runs, CAUSES)[0]


def test_a_crash_is_found_the_same_night_and_the_watch_goes_on() -> None:
    (alarm,) = crashed((3, 30.0))
    assert (alarm.run, alarm.first, alarm.last, alarm.leg, alarm.cause) == (31, 31, 31, 2, 3)
    assert alarm.change == pytest.approx(30.0, abs=4 * alarm.sigma)
    assert (alarm.other_legs, alarm.or_causes) == ((), ())
    first, second = crashed((3, 30.0), (0, -20.0))
    assert (first.leg, first.run) == (2, 31)
    assert (second.leg, second.run, second.first, second.cause) == (1, 61, 61, 0)
    assert second.change == pytest.approx(-20.0, abs=4 * second.sigma)


def test_causes_that_runs_do_not_tell_apart_and_another_leg_that_moved_are_named() -> None:
    robot, nearly_one = LinearRobot(), np.eye(6)
    nearly_one[1, :2] = [1.0, 1e-3]
    runs = list(robot.runs(30))
    robot.state[0] += 30.0
    (alarm,) = watch_runs([*runs, *robot.nights(3)], replace(CAUSES, by_state=nearly_one))[0]
    assert {alarm.cause, *(other for other, _ in alarm.or_causes)} == {0, 1}
    robot = LinearRobot(5)
    runs = list(robot.runs(30))
    robot.state[[0, 5]] += [40.0, 25.0]
    (alarm, *_) = watch_runs([*runs, *robot.nights(1)], CAUSES)[0]
    assert {alarm.leg, *alarm.other_legs} >= {1, 3}


NOISE, RATE, CRASH = 0.004, 0.0008, 0.12
"""mm: as those of a real robot."""


def moved(seed: int, nights: int, *motions: tuple[int, float, int]) -> tuple[StepAlarm, ...]:
    """A calibration, 60 quiet nights, and some before which parameters move by so much from a night on."""
    robot = LinearRobot(seed, NOISE)
    runs = list(robot.runs(60))
    for night in range(nights):
        for parameter, size, first in motions:
            robot.state[parameter] += size * (night >= first)
        runs += robot.nights(1)
    return watch_runs(runs, CAUSES)[0]


@pytest.mark.parametrize("seed", range(2))
def test_what_moves_on_steadily_is_of_its_leg_alone(seed) -> None:
    """It alarms again and again, by what it has moved since."""
    found = moved(seed, 100, (1, RATE, 0))
    assert {(one.leg, one.cause, one.other_legs) for one in found} == {(1, 1, ())}
    assert sum(one.possible_legs == (1,) for one in found) > 0.8 * len(found)
    assert 0.7 * 100 * RATE < sum(one.change for one in found) < 1.3 * 100 * RATE


def test_a_crash_while_another_leg_moves_on_is_a_change_of_its_own() -> None:
    found = moved(1, 140, (1, RATE, 0), (5, CRASH, 120), (5, -CRASH, 121))
    [crash] = [one for one in found if one.leg == 3]
    assert crash.run == 60 + 121
    assert crash.change == pytest.approx(CRASH, abs=4 * crash.sigma)
    assert {one.leg for one in found} == {1, 3}


@pytest.mark.parametrize("seed", range(2))
def test_a_leg_that_stood_still_after_a_crash_is_watched_as_before(seed) -> None:
    """Its next step, a small one, is found about as soon as that of a robot which never had one."""
    step = 0.5 * NOISE

    def noticed(*crash: tuple[int, float, int]) -> int:
        found = moved(seed, 240, *crash, (3, step, 100), (3, -step, 101))
        return next(one.run for one in found if one.run > 60 + 100)

    assert noticed((3, CRASH, 0), (3, -CRASH, 1)) <= noticed() + 2


def test_alarms_come_as_the_runs_do() -> None:
    robot, watch = LinearRobot(0), DriftWatch(CAUSES)
    assert not any(watch.add(run) for run in robot.runs(30))
    assert watch.share_of_limit.max() < 1.0
    robot.state[3] += 30.0
    assert watch.add(next(robot.nights(1)))
    assert watch.share_of_limit.max() == 0.0


def test_the_evidence_of_a_leg_is_of_all_its_parameters_and_all_it_may_be_are_named() -> None:
    sigmas = np.full(6, 0.01)
    assert possible_groups(np.array([5.0, 0, 0, 0, 0, 0]), sigmas, LEGS)[0] == 1
    assert possible_groups(np.array([5.0, 0, 4.9, 4.9, 0, 0]), sigmas, LEGS)[0] == 2
    unseen = np.where(LEGS == 3, np.inf, 0.01)
    assert possible_groups(np.array([5.0, 0, 0, 0, 0, 9.0]), unseen, LEGS)[0] == 1
    sigmas = np.full(6, 0.01)
    assert possible_groups(np.array([9.0, 0, 0, 0, 0, 0]), sigmas, LEGS) == (1,)
    assert possible_groups(np.array([5.0, 0, 4.9, 0, 0, 0]), sigmas, LEGS) == (1, 2)
    assert possible_groups(np.zeros(6), sigmas, LEGS) == (1, 2, 3)
