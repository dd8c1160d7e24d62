"""The paper's experiment in a simulation: what is left is the robot's repeatability."""

import numpy as np
import pytest

from hexacell.study import paper_experiment


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
