"""With zeros alone, what is forecast of error and verdict is what fit and verification then state."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from hexacell.campaign.decisions import Forecast
from hexacell.campaign.planner import Plan
from hexacell.cell.loader import load_cell
from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.dry_run.verdict_forecast import (
    predicted_held_out_sets,
    predicted_verdicts,
    stated_errors,
    with_held_out_records,
)
from hexacell.identification.estimator import identify
from hexacell.identification.identified_zeros import IdentifiedZeros
from hexacell.identification.solver.result import Identification
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, random_robot
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.verdict.decision import Verdict

CONFIGS = Path(__file__).parents[3] / "configs"


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A Gough-Stewart platform whose zeros are identified by all that was planned."""

    plan: Plan
    forecast: Forecast
    found: Identification
    zeros: IdentifiedZeros

    def budget(self, found: Identification, zeros: IdentifiedZeros | None = None) -> UncertaintyBudget:
        belief = self.plan.robot.belief(found)
        if zeros is not None:
            belief = replace(belief, covariance=zeros.free_covariance)
        budget = self.plan.task.budget(found, belief, self.plan.robot.effects, zeros=zeros)
        assert budget is not None
        return budget


def measured(base_mm: float) -> Measured:
    """With joints that are known as well as ``base_mm``."""
    cell = load_cell(CONFIGS / "gough-stewart.toml")
    tolerances = cell.settings.tolerances.model_copy(update={"base_mm": base_mm, "platform_mm": base_mm})
    plan = cell.settings.identification.model_copy(update={"identify": "zeros", "orientations": 4})
    settings: CellSettings = cell.settings.model_copy(
        update={"identification": plan, "tolerances": tolerances}
    )
    robot = robot_of(replace(cell, settings=settings))
    truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, np.random.default_rng(3))
    virtual = VirtualRobot(robot, truth, np.random.default_rng(1))
    campaign = VirtualCampaign(Plan(settings, robot, with_forecast=False), virtual)
    campaign.carry_out()
    forecast = campaign.plan.forecast(campaign.state)
    found = identify(campaign.plan.robot.problem(campaign.measurements))
    zeros = campaign.plan.robot.identified_zeros(found)
    assert forecast is not None
    assert zeros is not None
    return Measured(campaign.plan, forecast, found, zeros)


@pytest.fixture(scope="module")
def as_drawn() -> Measured:
    return measured(0.01)


@pytest.fixture(scope="module")
def roughly_built() -> Measured:
    return measured(2.0)


def test_the_forecast_is_what_the_fit_states(as_drawn: Measured, roughly_built: Measured) -> None:
    for one in (as_drawn, roughly_built):
        stated = one.budget(one.found, one.zeros).noise_mm
        assert one.forecast.now_mm == pytest.approx(stated, rel=0.03)


def test_the_verdict_is_forecast(as_drawn: Measured, roughly_built: Measured) -> None:
    """Zeros serve a machine whose joints are as drawn, and none whose joints are 2 mm off."""
    probabilities = []
    for one in (as_drawn, roughly_built):
        sets = predicted_held_out_sets(one.plan, one.found)
        told = predicted_verdicts(one.plan, one.found, one.budget(one.found, one.zeros), sets)
        assert told is not None
        probabilities.append(told.probabilities[Verdict.PASS])
    assert probabilities[0] > 0.99
    assert probabilities[1] < 0.01


def test_errors_are_stated_as_of_machines_that_are_drawn(roughly_built: Measured) -> None:
    """Each identified twice, with and without the held-out records; zeros of the first are written."""
    found, zeros = roughly_built.found, roughly_built.zeros
    sets = predicted_held_out_sets(roughly_built.plan, found)
    updated = with_held_out_records(roughly_built.plan, found, sets)
    second = roughly_built.budget(updated)
    stated = stated_errors(found, updated, roughly_built.budget(found, zeros), second, zeros)
    prior, random = found.problem.prior, np.random.default_rng(5)
    first = np.linalg.inv(found.free_covariance) - prior.precision
    added = np.linalg.inv(updated.free_covariance) - np.linalg.inv(found.free_covariance)
    truths = np.linalg.cholesky(prior.covariance) @ random.standard_normal((len(first), 4000))
    scores = first @ truths + _drawn(first, random)
    estimate = found.free_covariance @ scores
    better = updated.free_covariance @ (scores + added @ truths + _drawn(added, random))
    errors = np.einsum("tap,pn->tan", second.jacobian, zeros.projector @ estimate - better)
    np.testing.assert_allclose(np.var(errors, axis=-1), np.sum(stated**2, axis=-1), rtol=0.15)


def _drawn(information: np.ndarray, random: np.random.Generator) -> np.ndarray:
    values, vectors = np.linalg.eigh(information)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(factor @ random.standard_normal((len(values), 4000)))
