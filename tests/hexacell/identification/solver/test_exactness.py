"""Data without noise give the exact geometry, from start points that are drawn."""

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise, Tolerances
from hexacell.identification.solver import multistart
from hexacell.identification.solver.measurement_model import NuisanceElimination, predict
from hexacell.identification.solver.multistart import restarts
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.measurements.records import MeasurementSet
from hexacell.study import reference_solvers
from tests.hexacell.altered_records import altered
from tests.least_squares import least_squares_without_jacobian

EXACT_MM = 1e-6
SEEDS = range(5)


def assert_exact(found, true, records):
    assert found.termination.converged
    assert found.geometry.largest_difference(true) < EXACT_MM
    assert found.records == records
    assert found.data_faults == ()
    assert found.residual_rms_mm < EXACT_MM


@pytest.mark.parametrize("seed", SEEDS)
def test_the_papers_robot_from_five_points_of_eleven_orientations(paper, visit, make_problem, seed):
    found = identify(make_problem(visit(seed=seed).measured()))
    assert_exact(found, paper.actual, records=55)
    assert found.problem.points == 5
    assert found.dof == 3 * (55 - 5) - 35


def test_the_papers_solvers_find_the_same_geometry(visit, make_problem):
    problem = make_problem(visit(seed=2).measured())
    ours = identify(problem).geometry
    assert reference_solvers.gauss_newton(problem).largest_difference(ours) < EXACT_MM
    assert least_squares_without_jacobian(problem).largest_difference(ours) < EXACT_MM


@pytest.mark.parametrize("seed", range(2))
def test_other_robots_within_the_tolerances(hexaglide, paper, visit, make_problem, seed):
    errors = np.random.default_rng(seed).uniform(-7.0, 7.0, 35)
    true = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + hexaglide.convention.basis @ errors)
    found = identify(make_problem(visit(true, seed=seed).measured()))
    assert_exact(found, true, records=55)


def test_robots_far_from_the_drawing_and_as_drawn(paper, visit, make_problem) -> None:
    problem = make_problem(
        visit(paper.calibrated, seed=1).measured(),
        tolerances=Tolerances({"S": 7.0, "B": 7.0, "l": 7.0}, ball_mm=40.0),
    )
    assert_exact(identify(problem), paper.calibrated, records=55)
    assert_exact(identify(make_problem(visit(paper.nominal).measured())), paper.nominal, records=55)


@pytest.mark.parametrize(("points", "orientations"), [(2, 11), (5, 4)])
def test_few_records_are_enough_where_they_are_exact(paper, visit, make_problem, points, orientations):
    exact = visit(points=points, orientations=orientations, seed=1)
    found = identify(make_problem(exact.measured(), noise=Noise(1e-4, 1e-4)))
    assert_exact(found, paper.actual, records=points * orientations)


def test_where_the_gauges_were_zeroed_does_not_matter(visit, make_problem):
    """The constant of each point is an unknown."""
    measured = visit(seed=2).measured(0.01, seed=3)
    offsets = np.random.default_rng(0).uniform(-4.0, 4.0, (5, 3))
    moved = altered(measured, lambda r: {"deviation": np.add(r.deviation, offsets[r.point - 1])})
    there, here = identify(make_problem(moved)), identify(make_problem(measured))
    assert there.geometry.largest_difference(here.geometry) < EXACT_MM
    assert there.chi2 == pytest.approx(here.chi2)


@pytest.fixture(scope="module")
def problem(visit, make_problem):
    """Of few records, so that their poses are found under many of the drawn geometries."""
    return make_problem(MeasurementSet(visit(seed=2).measured(0.01, seed=1).records[:8]))


@pytest.fixture(scope="module")
def started(problem):
    return list(restarts(problem))


def test_the_poses_of_each_start_close_its_own_geometry(problem, started):
    assert len(started) > 3
    for one in started:
        alone = problem.solve_poses(one.initial_parameters)
        assert alone.found.all()
        np.testing.assert_allclose(one.start.positions, alone.poses.positions, atol=1e-8)
        np.testing.assert_allclose(one.start.rotations, alone.poses.rotations, atol=1e-10)


def test_every_drawn_geometry_that_records_can_take_counts_and_the_least_contradicted_are_first(
    problem, started
):
    def cost(free):
        solved = problem.solve_poses(free)
        prediction = predict(problem, free, solved.poses)
        if not solved.found.all() or prediction.singular.any():
            return np.inf
        return NuisanceElimination(problem, prediction.weights).cost(prediction.residuals)

    changes = multistart.tolerance_draws(problem)
    assert len(changes) == multistart.DRAWS
    least = np.sort([cost(problem.initial_parameters + change) for change in changes])
    expected = least[: multistart.START_POINTS]
    found = [cost(one.initial_parameters) for one in started]
    np.testing.assert_allclose(found, expected[np.isfinite(expected)], rtol=1e-6)


def test_half_of_the_draws_are_as_wide_as_the_prior_and_half_as_the_tolerances(problem):
    by_prior, by_tolerances = np.split(multistart.tolerance_draws(problem), 2)
    prior = problem.prior
    assert by_prior.std(axis=0) == pytest.approx(np.sqrt(np.diag(prior.covariance)), rel=0.3)
    assert by_tolerances.std(axis=0) == pytest.approx(prior.sigma, rel=0.3)
    assert by_prior.std() > 1.3 * by_tolerances.std()
