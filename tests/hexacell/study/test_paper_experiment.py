"""The paper's experiment in a simulation: what is left is the robot's repeatability."""

import numpy as np
import pytest

from hexacell.study.paper_experiment import (
    MEAN_DISTANCE,
    REPEATABILITIES_MM,
    Differences,
    Experiment,
    ExperimentOutcome,
    experiment_summary,
    experiments_of,
    run_experiment,
)


@pytest.fixture(scope="module")
def repeatable():
    return run_experiment(Experiment(0.0, 0))


def test_a_repeatable_robot_comes_back_to_the_place(repeatable) -> None:
    for part in (repeatable.calibrating, repeatable.verifying):
        assert np.mean(part.before) > 5.0
        assert np.mean(part.ours) < 0.2


def test_what_is_left_of_another_robot_is_its_repeatability() -> None:
    """Two places that scatter by s along each axis are 2.26 s apart in the mean: 4 s / sqrt(pi)."""
    found = run_experiment(Experiment(0.5, 0))
    places = np.random.default_rng(1).standard_normal((2, 100_000, 3))
    assert pytest.approx(np.linalg.norm(places[0] - places[1], axis=-1).mean(), rel=0.01) == MEAN_DISTANCE
    expected = MEAN_DISTANCE * 0.5
    assert 0.8 * expected < np.mean(found.calibrating.ours) < 2.0 * expected


def test_all_of_it_is_of_its_own_experiments() -> None:
    outcomes = {
        one: ExperimentOutcome(
            Differences((one.repeatability_mm,), (1.0,) if one.number else (), (0.1,), (0.1,)),
            Differences((10.0 * one.repeatability_mm,), (2.0,), (0.2,), (0.2,)),
        )
        for one in experiments_of(2)
    }
    study = experiment_summary(outcomes)
    assert tuple(row.calibrating.before for row in study.rows) == REPEATABILITIES_MM
    assert {(row.draws, row.ended) for row in study.rows} == {(2, 1)}
    assert study.example.calibrating.before == (2.0,)
