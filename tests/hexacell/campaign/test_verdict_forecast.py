"""The forecast of verdicts against machines that are simulated without any linearization."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.cell.measuring import AcceptanceSettings
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.dry_run.verdict_forecast import (
    NOISE,
    SEED,
    VerdictForecast,
    forecast_verdicts,
    predicted_held_out_sets,
    predicted_verdicts,
    stated_errors,
    with_held_out_records,
)
from hexacell.identification.diagnostics.model_tests import update
from hexacell.identification.estimator import identify
from hexacell.kinematics.forward import continue_solution
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.verdict.decision import Verdict

MACHINES = 60
SCALE_UM_M = 60.0


def limits_of(position_mm: float, orientation_deg: float) -> AcceptanceSettings:
    return AcceptanceSettings(
        position_mm=position_mm, orientation_deg=orientation_deg, guard_band_factor=1.0
    )


LIMITS = limits_of(0.15, 0.05)


class Cell:
    """A calibrated robot and the records of its run, to be measured again and again."""

    def __init__(self, plan, truth):
        uncertainty = UncertaintySettings(grade="ideal", encoder_scale_um_m=SCALE_UM_M)
        settings = plan.settings.model_copy(update={"uncertainty": uncertainty})
        self.plan = replace(plan, settings=settings, robot=plan.robot.with_errors_of(settings))
        campaign = VirtualCampaign(
            self.plan, VirtualRobot(self.plan.robot, truth, np.random.default_rng(4))
        )
        campaign.carry_out()
        self.found = self.plan.estimate(campaign.state).identification
        self.sets = predicted_held_out_sets(self.plan, self.found)
        self.updated = with_held_out_records(self.plan, self.found, self.sets)
        self.first, self.second = (self.budget(one) for one in (self.found, self.updated))

    def budget(self, found):
        return self.plan.task.budget(found, self.plan.robot.belief(found), self.plan.robot.effects)

    def statement(self, random):
        """What is stated of a machine with this geometry: noise and encoder scales drawn."""
        scales = 1e-6 * SCALE_UM_M * random.standard_normal(6)
        found = identify(self._measured(self.found, scales, random), find_outliers=False)
        held_out = self.updated.problem.labels[:, 0] > max(self.plan.points)
        further = self._measured(self.updated, scales, random).subset(held_out)
        updated = update(found, further)
        return self.budget(updated).errors_of(found.free - updated.free)

    def _measured(self, exact, scales, random):
        """The problem of an identification with readings of sliders that are where the scales put them."""
        problem, noise = exact.problem, self.plan.robot.noise
        shown = problem.joints
        actual = continue_solution(
            problem.mechanism,
            self.found.geometry,
            shown * (1.0 + scales),
            start=exact.poses,
            start_geometry=exact.geometry,
        )
        assert actual.found.all()
        seen = actual.poses.positions
        seen = seen + noise.gauges_mm * random.standard_normal(seen.shape)
        deviations = seen - problem.per_record(seen[problem.first_rows])
        joints = shown + noise.encoders * random.standard_normal(shown.shape)
        return replace(problem, joints=joints, deviations=deviations)


@pytest.fixture(scope="module")
def cell(make_plan, paper):
    points = ((0.0, -200.0, 550.0), (100.0, -100.0, 500.0), (-100.0, 100.0, 500.0))
    return Cell(make_plan(identification__points=points), paper.actual)


@pytest.fixture(scope="module")
def simulated(cell):
    random = np.random.default_rng(11)
    return [cell.statement(random) for _ in range(MACHINES)]


@pytest.fixture(scope="module")
def forecast(cell):
    return predicted_verdicts(cell.plan, cell.found, cell.first, cell.sets)


@pytest.mark.slow
def test_the_held_out_records_confirm_the_identification_and_lessen_its_covariance(cell) -> None:
    change = np.abs(cell.updated.free - cell.found.free)
    assert (change < 2e-3 * np.sqrt(np.diag(cell.found.free_covariance))).all()
    before, after = (one.free_covariance for one in (cell.found, cell.updated))
    assert np.linalg.eigvalsh(before - after).min() > -1e-9 * np.linalg.eigvalsh(before).max()
    assert np.trace(after) < 0.9 * np.trace(before)
    assert cell.updated.records - cell.found.records == 3 * 6


@pytest.mark.slow
def test_what_will_be_stated_is_as_large_as_in_simulated_verifications(cell, simulated) -> None:
    stated = stated_errors(cell.found, cell.updated, cell.first, cell.second)
    draws = np.random.default_rng(SEED).standard_normal((4000, stated.shape[-1]))
    errors = np.tensordot(draws, stated, axes=(1, 2))
    for part, scale in ((np.s_[..., :3], 1.0), (np.s_[..., 3:], 180.0 / np.pi)):
        expected = scale * np.linalg.norm(errors[part], axis=-1).max(axis=-1)
        seen = [one.position.value if scale == 1.0 else one.orientation.value for one in simulated]
        error = np.std(expected) / np.sqrt(MACHINES)
        assert np.mean(seen) == pytest.approx(np.mean(expected), abs=4.0 * error + 0.05 * np.mean(expected))
        assert np.std(seen) == pytest.approx(np.std(expected), rel=0.4)


def test_95_percent_pass_the_limits_that_are_proposed(cell, forecast) -> None:
    stated = stated_errors(cell.found, cell.updated, cell.first, cell.second)
    far = 100.0 * forecast.passing.orientation_deg
    told = forecast_verdicts(
        stated, cell.second, forecast.passing.model_copy(update={"orientation_deg": far})
    )
    assert told.probabilities[Verdict.PASS] == pytest.approx(0.95 * 0.997, abs=0.003)
    assert not told.is_wanted  # by the tests of the model
    wide = forecast_verdicts(stated, cell.second, limits_of(far, far))
    assert wide.is_wanted
    assert wide.probabilities[Verdict.PASS] == pytest.approx(0.997, abs=1e-3)
    tight = forecast_verdicts(stated, cell.second, limits_of(1e-6, 1e-6))
    assert tight.probabilities[Verdict.PASS] == 0.0


def test_the_largest_part_is_that_of_the_budget(cell, forecast) -> None:
    parts = {NOISE: cell.second.noise_mm}
    parts |= {line.effect.name: line.combined_mm for line in cell.second.lines}
    assert forecast.largest_part_mm == max(parts.values()) == parts[forecast.largest_part]
    assert forecast.standard_mm == cell.second.standard_mm


def test_of_several_robots_the_shares_are_averaged_and_the_worst_is_told() -> None:
    def of(share, limit):
        probabilities = dict.fromkeys(Verdict, 0.0) | {Verdict.PASS: share, Verdict.FAIL: 1.0 - share}
        return VerdictForecast(
            probabilities, LIMITS, limits_of(limit, 0.2 - limit), f"part {limit}", limit, 2.0 * limit
        )

    mean = VerdictForecast.mean([of(0.9, 0.1), of(0.5, 0.15)])
    assert mean.probabilities[Verdict.PASS] == pytest.approx(0.7)
    assert (mean.passing.position_mm, mean.passing.orientation_deg) == (0.15, 0.1)
    assert (mean.largest_part, mean.largest_part_mm, mean.standard_mm) == ("part 0.15", 0.15, 0.3)


def test_without_held_out_poses_nothing_is_forecast(cell) -> None:
    settings = cell.plan.settings
    far = settings.verification.model_copy(update={"points": ((5000.0, 0.0, 550.0),)})
    plan = replace(cell.plan, settings=settings.model_copy(update={"verification": far}))
    sets = predicted_held_out_sets(plan, cell.found)
    assert not sets
    assert predicted_verdicts(plan, cell.found, cell.first, sets) is None
    assert predicted_verdicts(cell.plan, cell.found, None, cell.sets) is None
