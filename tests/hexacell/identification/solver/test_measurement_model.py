"""Stations placed by hand: rotated slightly against the base, with gauges of slightly wrong scale."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.altered_records import altered
from tests.hexacell.conftest import visits

ALIGNMENT = float(np.radians(0.3))
SCALE = 0.002
STATED = Noise(0.01, 0.01, alignment=ALIGNMENT, gauge_scale=SCALE)


def set_up(seed: int) -> MeasurementSet:
    """Measurements with stations turned by 0.3 deg and gauges off by 0.2 %, one sigma each."""
    random = np.random.default_rng(1000 + seed)
    turns = Rotation.from_rotvec(ALIGNMENT * random.standard_normal((5, 3))).as_matrix()
    scale = 1.0 + SCALE * random.standard_normal(3)

    def seen(record):
        joints = np.add(record.joints, 0.01 * random.standard_normal(6))
        shown = scale * (turns[record.point - 1] @ record.deviation)
        return {"joints": joints, "deviation": shown + 0.01 * random.standard_normal(3)}

    return altered(visits(seed=2).measured(), seen)


def test_the_covariance_predicts_the_errors_with_misaligned_stations(paper, make_problem):
    count = 12
    errors, chi_squares = [], []
    for seed in range(count):
        found = identify(make_problem(set_up(seed), noise=STATED))
        assert found.data_faults == ()
        error = found.free - found.problem.mechanism.convention.free_parameters(paper.actual)
        errors.append(error @ np.linalg.solve(found.free_covariance, error))
        chi_squares.append(found.chi2)
    for values, degrees in ((errors, 35 * count), (chi_squares, 115 * count)):
        low, high = chi2.interval(1.0 - 1e-4, degrees)
        assert low < sum(values) < high


def test_unmodelled_misalignment_costs_accuracy_and_fails_the_chi_square_test(paper, make_problem):
    knowing = identify(make_problem(set_up(0), noise=STATED))
    unaware = identify(make_problem(set_up(0), noise=Noise(0.01, 0.01)))
    assert unaware.chi2 > 10 * unaware.dof
    ours, theirs = (found.geometry.largest_difference(paper.actual) for found in (knowing, unaware))
    assert ours < 0.5 * theirs


def test_a_station_that_is_surely_straight_is_the_limit_of_one_that_hardly_turns(
    noisy, make_problem, identified
):
    hardly = identify(make_problem(noisy, noise=Noise(0.01, 0.01, alignment=1e-9, gauge_scale=1e-9)))
    assert hardly.geometry.largest_difference(identified.geometry) < 1e-5
    np.testing.assert_allclose(hardly.sigma, identified.sigma, rtol=1e-4)
    assert hardly.chi2 == pytest.approx(identified.chi2, rel=1e-4)
