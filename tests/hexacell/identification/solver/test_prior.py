"""The tolerance prior: it determines what the data do not, and gives no bias elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.identification.estimator import estimate_online, identify
from hexacell.identification.problem.problem import Prior, Tolerances
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS


def test_the_prior_has_the_moments_of_errors_within_the_tolerances(hexaglide, paper):
    prior = Prior.of(hexaglide, paper.nominal, Tolerances({"S": 3.0, "B": 6.0, "l": 1.5}))
    names = hexaglide.convention.free_names()
    widths = {"S": 3.0, "B": 6.0, "l": 1.5}
    expected = np.diag([widths[name[0]] ** 2 / 3.0 for name in names])
    np.testing.assert_allclose(prior.covariance, expected)
    np.testing.assert_array_equal(prior.centre.vector, paper.nominal.vector)


def test_the_balls_mounting_moves_all_platform_joints_together(hexaglide, paper):
    prior = Prior.of(hexaglide, paper.nominal, Tolerances({"S": 7.0, "B": 7.0, "l": 7.0}, ball_mm=30.0))
    names = hexaglide.convention.free_names()
    for n, one in enumerate(names):
        for m, other in enumerate(names):
            together = one[0] == other[0] == "B" and one[-1] == other[-1]
            own = 49.0 / 3.0 if n == m else 0.0
            assert prior.covariance[n, m] == pytest.approx(own + (300.0 if together else 0.0))


def test_the_prior_is_released_where_the_data_determine_the_parameters(paper, visit, make_problem):
    """Exact data: whatever of the prior is left in pulls the estimate away from the truth."""
    problem = make_problem(visit(seed=2).measured())
    assert estimate_online(problem).geometry.largest_difference(paper.actual) > 1e-3
    assert identify(problem).geometry.largest_difference(paper.actual) < 1e-6


def test_another_drawing_gives_the_same_result(hexaglide, paper, visit, make_problem):
    measured = visit(seed=2).measured(0.01, seed=4)
    errors = np.random.default_rng(1).uniform(-3.0, 3.0, 35)
    other = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + hexaglide.convention.basis() @ errors)
    here, there = (identify(make_problem(measured, drawing=drawing)) for drawing in (paper.nominal, other))
    assert here.geometry.largest_difference(there.geometry) < 1e-5


@pytest.fixture(scope="module")
def small_tilts(visit, make_problem):
    return identify(make_problem(visit(degrees=3.0, seed=1).measured(0.01, seed=1)))


def test_parameters_undetermined_by_small_tilts_are_named(small_tilts):
    assert small_tilts.converged
    assert len(small_tilts.undetermined) >= 5
    told = dict(zip(HEXAGLIDE_PARAMETERS.names, small_tilts.sigma / 7.0 * np.sqrt(3.0), strict=True))
    for name in small_tilts.undetermined:
        assert told[name] > 0.5
    determined = (
        set(HEXAGLIDE_PARAMETERS.names)
        - set(small_tilts.undetermined)
        - set(small_tilts.problem.mechanism.convention.zero)
    )
    assert all(told[name] <= 0.5 for name in determined)


def test_parameters_undetermined_by_small_tilts_stay_near_the_drawing(small_tilts, paper, hexaglide):
    """Errors are within a few of their sigmas, and sigmas within the prior's."""
    free = hexaglide.convention.free_parameters
    error = small_tilts.free - free(paper.actual)
    plausible = error @ np.linalg.solve(small_tilts.free_covariance, error)
    assert plausible < 35 + 5 * np.sqrt(70)
    assert (small_tilts.sigma <= small_tilts.prior_sigma + 1e-9).all()
    assert np.abs(small_tilts.free - free(paper.nominal)).max() < 15.0


def test_more_records_leave_fewer_parameters_undetermined(visit, make_problem):
    exact = visit(seed=2)
    measured = exact.measured(0.01, seed=1)
    sigmas = []
    for count in (1, 3, 6, 11):
        rows = tuple(record for record in measured.records if record.orientation <= count)
        sigmas.append(np.trace(estimate_online(make_problem(type(measured)(rows))).free_covariance))
    assert sigmas == sorted(sigmas, reverse=True)


def test_the_online_estimate_starts_without_records(paper, visit, make_problem):
    """After the first record the estimate is the drawing with its tolerances."""
    measured = visit(seed=2).measured()
    first = type(measured)(measured.records[:1])
    estimate = estimate_online(make_problem(first))
    assert estimate.converged
    np.testing.assert_allclose(estimate.geometry.vector, paper.nominal.vector, atol=1e-9)
    np.testing.assert_allclose(estimate.sigma, estimate.prior_sigma, rtol=1e-9)


def test_the_online_estimate_continues_from_the_previous_one(visit, make_problem):
    problem = make_problem(visit(seed=2).measured(0.01, seed=1))
    cold = estimate_online(problem)
    warm = estimate_online(problem.starting_at(cold.free, cold.poses))
    assert warm.geometry.largest_difference(cold.geometry) < 1e-6
    assert warm.solution.iterations <= 2
    assert warm.solution.iterations < cold.solution.iterations
