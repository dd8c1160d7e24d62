"""The chain of estimates: false records are left out; computed again it gives the same."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from hexacell.campaign import online_estimate
from hexacell.campaign.online_estimate import ChainedEstimate, OnlineEstimator, cost, update_estimate
from hexacell.errors import LimitError
from hexacell.identification.estimator import estimate_online
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.altered_records import altered
from tests.hexacell.conftest import problem_of

FALSE = (2, 5)
OTHERS = (1, 3)
"""A record before the others determine anything."""


def one_mm_more(d):
    return np.add(d, [0.0, 0.0, 1.0])


def with_change(measurements, label, change):
    """The readings d (3,) of one record, or of all, replaced by ``change(d)``."""
    return altered(
        measurements,
        lambda r: {"deviation": change(np.array(r.deviation))},
        lambda r: label in {None, r.id},
    )


def chain(measurements, tries_others=True):
    """All estimates of the chain, that of the first record first."""
    last, every = None, []
    for count in range(1, len(measurements) + 1):
        problem = problem_of(MeasurementSet(measurements.records[:count]))
        last = update_estimate(problem, last, tries_others)
        every.append(last)
    return every


@pytest.mark.sample("label1")
@pytest.mark.parametrize("label", [FALSE, OTHERS, (2, 1), (3, 2)])
def test_a_false_record_is_left_out_once_the_others_prove_it_and_changes_nothing(
    noisy, make_problem, label
):
    every = chain(with_change(noisy, label, one_mm_more))
    first = next(number for number, one in enumerate(every) if one.false_records)
    assert every[first].identification.problem.is_overdetermined
    points = [record.point for record in noisy.records]
    for count, one in enumerate(every[first:], start=first + 1):
        # Of two records at a point nobody can tell which is false.
        either = {(label[0], 1), label} if points[:count].count(label[0]) == 2 else {label}
        assert len(one.false_records) == 1
        assert one.false_records <= either
    assert label != OTHERS or first < 25
    last = every[-1]
    others = MeasurementSet(tuple(record for record in noisy.records if record.id != label))
    without = estimate_online(make_problem(others))
    sigma = np.sqrt(np.diag(without.free_covariance))
    assert np.abs((last.identification.free - without.free) / sigma).max() < 1e-2


def test_no_record_of_good_ones_is_left_out(noisy):
    assert not any(one.false_records for one in chain(noisy))


def test_a_robot_near_its_prior_keeps_all_records(noisy):
    spoilt = with_change(noisy, FALSE, one_mm_more)
    last = chain(spoilt, tries_others=False)[-1]
    assert last.identification.records == len(noisy)
    assert not last.false_records


@pytest.mark.parametrize(
    ("cost", "records", "outdated"),
    [(100.0, 20, False), (199.0, 29, False), (200.0, 20, True), (100.0, 30, True), (10.0, 10, False)],
)
def test_a_search_is_repeated_for_twice_the_cost_or_half_as_many_records_again(cost, records, outdated):
    assert (
        ChainedEstimate(cast("Any", None), in_vain=(100.0, 20)).may_be_searched(cost, records) is outdated
    )


@pytest.fixture
def records(campaign):
    return campaign[-1].state.measurements.records


def estimates(robot, *sets):
    tracker = OnlineEstimator(robot)
    return [tracker.estimate(MeasurementSet(tuple(records))).identification for records in sets]


def test_before_the_first_record_the_estimate_is_the_drawing(two_points):
    known = OnlineEstimator(two_points.robot).estimate(MeasurementSet(()))
    assert known.identification is None
    np.testing.assert_array_equal(known.belief.covariance, two_points.robot.prior.covariance)
    with pytest.raises(LimitError):
        known.gauge_zero(1)


def test_the_estimate_does_not_depend_on_earlier_calls(two_points, records):
    """Record by record, at once, after others, after too many: the same to the last bit."""
    robot = two_points.robot
    one_by_one = estimates(robot, *[records[:count] for count in range(1, 11)])[-1]
    at_once = estimates(robot, records[:10])[-1]
    after_others = estimates(robot, records[8:], records[:10])[-1]
    after_more = estimates(robot, records, records[:10])[-1]
    for other in (at_once, after_others, after_more):
        np.testing.assert_array_equal(other.free, one_by_one.free)
        np.testing.assert_array_equal(other.free_covariance, one_by_one.free_covariance)


def test_the_continued_estimate_equals_the_estimate_from_the_drawing(two_points, records):
    chained = estimates(two_points.robot, records)[0]
    anew = estimate_online(two_points.robot.problem(MeasurementSet(records)))
    sigma = np.sqrt(np.diag(anew.free_covariance))
    assert np.abs((chained.free - anew.free) / sigma).max() < 1e-3
    np.testing.assert_allclose(np.sqrt(np.diag(chained.free_covariance)), sigma, rtol=1e-3)


def test_an_implausible_estimate_is_repeated_from_other_starts(two_points, records):
    """Continued from a distant estimate it would end in a local minimum, which its cost shows."""
    problem = two_points.robot.problem(MeasurementSet(records))
    good = estimate_online(problem)
    before = estimate_online(two_points.robot.problem(MeasurementSet(records[:-1])))
    far = before.free + 10.0 * np.sign(np.sin(2.0 * np.arange(len(before.free))))
    prediction = replace(before.prediction, free=far)
    worse = replace(before, solution=replace(before.solution, prediction=prediction))
    found = update_estimate(problem, ChainedEstimate(worse)).identification
    assert cost(found) <= cost(good) * (1.0 + 1e-6)


def test_the_zero_is_where_the_gauges_were_zeroed(two_points, records, paper):
    known = OnlineEstimator(two_points.robot).estimate(MeasurementSet(records))
    found = known.identification
    assert found is not None
    rows = np.flatnonzero(found.problem.labels[:, 0] == 2)
    zeroed = found.poses.positions[rows] - found.problem.deviations[rows]
    station = known.gauge_zero(2)
    assert np.abs(station.reference - zeroed.mean(axis=0)).max() < 0.05
    with pytest.raises(LimitError):
        known.gauge_zero(3)


def test_the_pose_of_a_record_that_is_gone_is_given_to_no_other(noisy, make_problem):
    problem = make_problem(MeasurementSet(noisy.records[:9]))
    before = estimate_online(problem.subset(np.arange(9) < 8))
    less = problem.subset(np.arange(9) != 3)
    some, every = (cast("Any", online_estimate._start_poses(one, before)) for one in (less, problem))
    np.testing.assert_array_equal(some.positions, np.delete(every.positions, 3, axis=0))
