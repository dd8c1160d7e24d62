"""The tolerance prior: it determines what the data do not, and gives no bias elsewhere."""

import numpy as np
import pytest

from hexacell.identification.estimator import estimate_online, identify
from hexacell.identification.problem.prior import Prior, Tolerances
from hexacell.kinematics import rotations
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import FrameTransform
from hexacell.robot.virtual_robot import random_robot


def covariance_of_drawn(mechanism, drawing, tolerances, count=4000):
    """Of the free parameters of robots built after a drawing, in its frames."""
    random = np.random.default_rng(1)
    drawn = [random_robot(mechanism, drawing, tolerances, random) for _ in range(count)]
    return np.cov(np.array([mechanism.convention.free_parameters(one) for one in drawn]).T)


@pytest.mark.parametrize(
    "tolerances",
    [
        Tolerances({"S": 3.0, "B": 3.0, "l": 3.0}),
        Tolerances({"S": 1.0, "B": 2.0, "l": 0.5}),
        Tolerances({"S": 1.0, "B": 1.0, "l": 1.0}, ball_mm=30.0),
    ],
    ids=["alike", "different", "with the ball"],
)
def test_the_prior_has_the_covariance_of_robots_built_within_the_tolerances(hexaglide, paper, tolerances):
    prior = Prior.of(hexaglide, paper.nominal, tolerances)
    drawn = covariance_of_drawn(hexaglide, paper.nominal, tolerances)
    np.testing.assert_array_equal(prior.centre.vector, paper.nominal.vector)
    np.testing.assert_allclose(np.diag(drawn), np.diag(prior.covariance), rtol=0.12)
    scale = np.sqrt(np.diag(prior.covariance))
    np.testing.assert_allclose(
        drawn / np.outer(scale, scale), prior.covariance / np.outer(scale, scale), atol=0.08
    )


def test_a_drawing_in_other_frames_is_the_same_prior(hexaglide, paper):
    tolerances = Tolerances({"S": 3.0, "B": 2.0, "l": 1.0}, ball_mm=4.0)
    frames = FrameTransform(
        rotations.from_vector([0.7, 0.0, 0.0]),
        np.array([10.0, 20.0, 30.0]),
        rotations.from_vector([1.0, -0.5, 0.2]),
    )
    other = Prior.of(hexaglide, hexaglide.change_frames(paper.nominal, frames), tolerances)
    expected = Prior.of(hexaglide, paper.nominal, tolerances)
    np.testing.assert_allclose(other.covariance, expected.covariance, atol=1e-5)
    np.testing.assert_allclose(other.free, expected.free, atol=1e-9)


def test_by_its_own_tolerance_a_parameter_is_as_uncertain_as_drawn(hexaglide, paper):
    """The frames' share counts neither for nor against what data determine of a parameter."""
    tolerances = Tolerances({"S": 3.0, "B": 4.0, "l": 1.5}, ball_mm=3.0)
    prior = Prior.of(hexaglide, paper.nominal, tolerances)
    expected = {"S": 3.0, "B": 5.0, "l": 1.5}
    for name, sigma in zip(hexaglide.convention.free_names, prior.sigma, strict=True):
        assert sigma == pytest.approx(expected[name[0]] / np.sqrt(3.0))


def test_the_prior_is_released_where_the_data_determine_the_parameters(paper, visit, make_problem):
    """Exact data: whatever of the prior is left in pulls the estimate away from the truth."""
    problem = make_problem(visit(seed=2).measured())
    assert estimate_online(problem).geometry.largest_difference(paper.actual) > 1e-3
    assert identify(problem).geometry.largest_difference(paper.actual) < 1e-6


@pytest.fixture(scope="module")
def small_tilts(visit, make_problem):
    return identify(make_problem(visit(degrees=3.0, seed=1).measured(0.01, seed=1)))


def test_parameters_undetermined_by_small_tilts_are_named(small_tilts):
    assert small_tilts.termination.converged
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


def test_the_online_estimate_starts_without_records(paper, visit, make_problem):
    """After the first record the estimate is the drawing with its tolerances."""
    measured = visit(seed=2).measured()
    first = type(measured)(measured.records[:1])
    estimate = estimate_online(make_problem(first))
    assert estimate.termination.converged
    np.testing.assert_allclose(estimate.geometry.vector, paper.nominal.vector, atol=1e-9)
    np.testing.assert_allclose(
        estimate.free_covariance, estimate.problem.prior.covariance, rtol=1e-6, atol=1e-6
    )


def test_the_online_estimate_continues_from_the_previous_one(visit, make_problem):
    problem = make_problem(visit(seed=2).measured(0.01, seed=1))
    cold = estimate_online(problem)
    warm = estimate_online(problem.starting_at(cold.free, cold.poses))
    assert warm.geometry.largest_difference(cold.geometry) < 1e-6
    assert warm.solution.iterations <= 2
    assert warm.solution.iterations < cold.solution.iterations
