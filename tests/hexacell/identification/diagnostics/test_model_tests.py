"""Further records update an identification, and test it."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.errors import IdentifiabilityError
from hexacell.identification.diagnostics.model_tests import leave_one_point_out, prediction_test, update
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.altered_records import later

NOISE_MM = 0.01
REPETITIONS = 16


@pytest.fixture(scope="module")
def measured(visit):
    """The exact records of five points, and of two more orientations at three of them."""
    return visit(seed=2), visit(points=3, orientations=6, seed=7)


def further(make_problem, exact, seed, **changes):
    """Noisy records at points of their own."""
    return make_problem(later(exact.measured(NOISE_MM, seed)), **changes)


def held_out_test(found, problem):
    updated = update(found, problem)
    return prediction_test(updated, updated.problem.labels[:, 0] > 5)


def test_an_update_is_the_fit_of_all_records_together(measured, make_problem):
    """Records are independent: first the ones and then the others is the same as all at once."""
    first = measured[0].measured(NOISE_MM, 1)
    updated = update(identify(make_problem(first)), further(make_problem, measured[1], 2))
    every = MeasurementSet((*first.records, *later(measured[1].measured(NOISE_MM, 2)).records))
    together = identify(make_problem(every), find_outliers=False)
    sigma = np.sqrt(np.diag(together.free_covariance))
    assert np.abs(updated.free - together.free).max() < 0.02 * sigma.max()
    np.testing.assert_allclose(np.sqrt(np.diag(updated.free_covariance)), sigma, rtol=0.02)


def test_further_records_of_the_same_machine_agree(measured, make_problem):
    """Their chi-square has its degrees of freedom as mean, and twice them as variance."""
    tests = []
    for seed in range(REPETITIONS):
        found = identify(make_problem(measured[0].measured(NOISE_MM, seed)), find_outliers=False)
        tests.append(held_out_test(found, further(make_problem, measured[1], 1000 + seed)))
    freedom = tests[0].expected
    assert freedom == 3 * (18 - 3)
    mean = np.mean([test.chi2 for test in tests])
    assert abs(mean - freedom) < 4.0 * np.sqrt(2.0 * freedom / REPETITIONS)
    assert min(test.probability for test in tests) > 1e-4


def test_further_records_of_a_machine_that_has_changed_do_not_agree(visit, measured, paper, make_problem):
    found = identify(make_problem(measured[0].measured(NOISE_MM, 1)))
    lengths = paper.actual["l"] + np.array([0.3, 0.0, 0.0, -0.3, 0.0, 0.0])
    bent = type(paper.actual).of(paper.actual.parameters, {**paper.actual.document(), "l": lengths})
    changed = visit(bent, points=3, orientations=6, seed=7)
    assert held_out_test(found, further(make_problem, changed, 3)).probability < 1e-3


def test_held_out_records_at_which_no_geometry_has_a_pose_prove_nothing(measured, make_problem):
    """They are refused: a test without any record could not fail."""
    found = identify(make_problem(measured[0].measured(NOISE_MM, 1)))
    problem = further(make_problem, measured[1], 2)
    unreachable = replace(problem, joints=problem.joints + np.array([900.0, 0.0, 0.0, 0.0, 0.0, -900.0]))
    with pytest.raises(IdentifiabilityError, match="has a pose at any held-out record"):
        update(found, unreachable)


def test_every_point_is_predicted_by_the_others(identified):
    points = leave_one_point_out(identified)
    assert [*points] == [1, 2, 3, 4, 5]
    assert all(test.expected == 30 for test in points.values())
    assert min(test.probability for test in points.values()) > 1e-4


def test_a_point_measured_with_another_gauge_scale_is_not_predicted(visit, make_problem):
    """The gauges of the second point show 3 % too much, which the stated noise does not know."""
    records = [
        record
        if record.point != 2
        else replace(record, deviation=tuple(1.03 * value for value in record.deviation))
        for record in visit(seed=2).measured(NOISE_MM, 1).records
    ]
    exact = Noise(NOISE_MM, NOISE_MM)
    found = identify(make_problem(MeasurementSet(tuple(records)), noise=exact), find_outliers=False)
    points = leave_one_point_out(found)
    assert min(points, key=lambda point: points[point].probability) == 2
    assert points[2].probability < 1e-3


def test_points_that_the_others_do_not_determine_are_not_tested(visit, make_problem):
    found = identify(make_problem(visit(points=2, orientations=9).measured(NOISE_MM, 1)))
    assert leave_one_point_out(found) == {}
