"""Start points of the solver: drawn within the tolerances, solved in one batch, the best ones first."""

import numpy as np
import pytest

from hexacell.identification.solver import multistart
from hexacell.identification.solver.measurement_model import NuisanceElimination, predict
from hexacell.identification.solver.multistart import restarts
from hexacell.measurements.records import MeasurementSet


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
