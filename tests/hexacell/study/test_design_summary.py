"""What many calibrations say together, of outcomes that are known; and trials of real robots."""

import json
from math import isnan

import pytest

from hexacell.cli.commands.study import STUDIES, design_lines
from hexacell.study import design_study
from hexacell.study.design_records import OrientationChoice


def outcome(trial: design_study.DesignTrial) -> design_study.DesignOutcome:
    """Errors that grow with the robot's number, the noise, and the choice's place in the list."""
    factor = 1 + list(OrientationChoice).index(trial.choice)
    error = factor * (trial.number + 1) * trial.noise_mm
    accuracies = tuple(
        design_study.RecordsAccuracy(11 * points, error, 0.1 * error, 0.01 * error)
        for points in (2, 3, 4, 5)
    )
    return design_study.DesignOutcome(accuracies, 4.0)


def study(robots: int):
    return design_study.design_summary({one: outcome(one) for one in design_study.design_trials_of(robots)})


def test_each_figure_is_of_its_own_trials() -> None:
    found = study(3)
    assert [one.tried for one in found.choices.values()] == [3] * len(OrientationChoice)
    adaptive = found.choices["adaptive"].by_records
    assert list(adaptive) == [22, 33, 44, 55]
    assert adaptive[55].largest_mm == pytest.approx(0.02)
    assert found.sweeps["noise, mm"][0.05].largest_mm == pytest.approx(0.1)
    assert found.noise_ratio == pytest.approx(
        {"best fixed": 2.0, "sifted random": 3.0, "random": 4.0, "paper": 5.0}
    )


def test_robots_that_are_not_identified_are_counted() -> None:
    outcomes = {one: outcome(one) for one in design_study.design_trials_of(2)}
    outcomes |= {
        one: design_study.DesignOutcome(reason="out of reach")
        for one in outcomes
        if one.number == 1 or one.choice is OrientationChoice.PAPER
    }
    found = design_study.design_summary(outcomes)
    assert (found.choices["random"].tried, found.choices["random"].by_records[55].robots) == (2, 1)
    assert found.choices["paper"].by_records == {}
    assert isnan(found.noise_ratio["paper"])
    text = "\n".join(design_lines(found))
    assert "none of 2 robots" in text
    assert json.dumps(STUDIES["design"].document(found), allow_nan=False)
