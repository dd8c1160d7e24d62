"""The paper's simulation: both estimators on the same records, whoever computes it and however often."""

import pytest

from hexacell.study import paper_simulation

MOST = paper_simulation.Trial(5, 11, 0)


@pytest.fixture(scope="module")
def most():
    return paper_simulation.run_trial(MOST)


def test_without_noise_both_find_the_robot(most) -> None:
    assert max(most.exact.paper_mm, most.exact.ours_mm) < 1e-6


def test_with_noise_errors_are_those_of_the_order_of_the_paper(most) -> None:
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
