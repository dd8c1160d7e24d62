"""The paper's simulation and experiment have figures of its order; its method, eq. 5 to 13, its minimum."""

import numpy as np
import pytest

from hexacell.errors import ConvergenceError
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver import fit as levenberg_marquardt
from hexacell.identification.solver.fit import FINE
from hexacell.identification.solver.measurement_model import predict
from hexacell.study import paper_experiment, paper_simulation, reference_solvers

MOST = paper_simulation.Trial(5, 11, 0)


@pytest.fixture(scope="module")
def most():
    return paper_simulation.run_trial(MOST)


def test_without_noise_both_find_the_robot_and_with_noise_they_err_as_the_paper_does(most) -> None:
    assert max(most.exact.paper_mm, most.exact.ours_mm) < 1e-6
    assert 0.05 < most.noisy.ours_mm < most.noisy.paper_mm < 5.0


@pytest.mark.parametrize(("points", "orientations"), [(1, 11), (2, 5)])
def test_what_cannot_be_identified_is_refused(points: int, orientations: int) -> None:
    found = paper_simulation.run_trial(paper_simulation.Trial(points, orientations, 0))
    assert found.exact.ours == found.noisy.ours == {}
    assert found.exact.paper_mm > 1.0


def errors(paper: float | None, ours: float | None) -> paper_simulation.Errors:
    return paper_simulation.Errors(
        {} if paper is None else {"S": paper, "B": 0.1, "l": 0.1},
        {} if ours is None else {"S": ours, "B": 0.1, "l": 0.1},
    )


def test_medians_are_of_the_draws_that_each_estimator_ends() -> None:
    found = paper_simulation.MedianErrors.of(
        [errors(1.0, 0.5), errors(3.0, 0.7), errors(None, 0.3), errors(2.0, None)]
    )
    assert (found.trials, found.settled, found.refused) == (4, 3, 1)
    assert (found.paper_mm, found.ours_there_mm, found.ours_mm) == (2.0, 0.6, 0.5)


def test_all_of_it_is_of_its_own_trials() -> None:
    outcomes = {
        one: paper_simulation.Outcome(
            errors(one.points, 0.5), errors(one.orientations, 0.1), 10.0 * one.points
        )
        for one in paper_simulation.trials_of(2)
    }
    study = paper_simulation.summary(outcomes)
    assert [one.exact.paper_mm for one in study.figures[4]] == [1, 2, 3, 4, 5]
    assert {one.noisy.paper_mm for one in study.figures[5]} == {5}
    assert [one.deviation_mm for one in study.figures[5]] == [10, 20, 30, 40, 50]
    assert {kind: tuple(found.values()) for kind, found in study.table_2.items()} == {
        "S": (11.0, 0.1),
        "B": (0.1, 0.1),
        "l": (0.1, 0.1),
    }


@pytest.fixture(scope="module")
def repeatable():
    return paper_experiment.run_experiment(paper_experiment.Experiment(0.0, 0))


def test_a_repeatable_robot_comes_back_to_the_place(repeatable) -> None:
    for part in (repeatable.calibrating, repeatable.verifying):
        assert np.mean(part.before) > 5.0
        assert np.mean(part.ours) < 0.2


def test_what_is_left_of_another_robot_is_its_repeatability() -> None:
    """Two places that scatter by s along each axis are 2.26 s apart in the mean: 4 s / sqrt(pi)."""
    found = paper_experiment.run_experiment(paper_experiment.Experiment(0.5, 0))
    places = np.random.default_rng(1).standard_normal((2, 100_000, 3))
    assert (
        pytest.approx(np.linalg.norm(places[0] - places[1], axis=-1).mean(), rel=0.01)
        == paper_experiment.MEAN_DISTANCE
    )
    expected = paper_experiment.MEAN_DISTANCE * 0.5
    assert 0.8 * expected < np.mean(found.calibrating.ours) < 2.0 * expected


def test_all_of_it_is_of_its_own_experiments() -> None:
    outcomes = {
        one: paper_experiment.ExperimentOutcome(
            paper_experiment.Differences(
                (one.repeatability_mm,), (1.0,) if one.number else (), (0.1,), (0.1,)
            ),
            paper_experiment.Differences((10.0 * one.repeatability_mm,), (2.0,), (0.2,), (0.2,)),
        )
        for one in paper_experiment.experiments_of(2)
    }
    study = paper_experiment.experiment_summary(outcomes)
    assert tuple(row.calibrating.before for row in study.rows) == paper_experiment.REPEATABILITIES_MM
    assert {(row.draws, row.ended) for row in study.rows} == {(2, 1)}
    assert study.example.calibrating.before == (2.0,)


@pytest.fixture(scope="module")
def problem(noisy, make_problem):
    return make_problem(noisy)


def test_the_pairwise_minimum_is_the_unweighted_centred_one(noisy, make_problem, problem):
    """With no noise on the encoders all weights are equal, and centring is subtracting the mean."""
    unweighted = make_problem(noisy, noise=Noise(encoder=0.0, gauge_mm=0.01))
    parameters = len(problem.prior.covariance)
    start = predict(unweighted, unweighted.prior.free, unweighted.start)
    centred = levenberg_marquardt.solve(unweighted, np.zeros((parameters, parameters)), start, FINE)
    assert centred.termination.converged
    pairwise = problem.mechanism.convention.free_parameters(reference_solvers.gauss_newton(problem))
    np.testing.assert_allclose(centred.prediction.free, pairwise, rtol=0, atol=1e-6)


def test_gauss_newton_reports_that_it_left_the_assembly_mode(visit, make_problem):
    """From errors of millimetres it may step over a singularity; the paper asks for a good start."""
    with pytest.raises(ConvergenceError, match="assembly mode"):
        reference_solvers.gauss_newton(make_problem(visit(seed=0).measured()))


def test_gauss_newton_reports_that_it_did_not_converge(problem):
    with pytest.raises(ConvergenceError, match="in 2 steps"):
        reference_solvers.gauss_newton(problem, steps=2)
