"""The dry run of a plan on virtual robots; repeatable."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.budget import usual_move_seconds
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.config.interface import ControllerGeometry
from hexacell.dry_run.campaign import dry_run
from hexacell.robot.model import make_robot
from hexacell.robot.stated import stated_effects
from hexacell.robot.virtual_robot import robots_within_tolerances
from tests.geometries import hexaglide_geometry
from tests.hexacell.campaign.conftest import at_two_points

SEED = {"identification__seed": 2}  # whose first robot can be measured


@pytest.fixture(scope="module")
def result():
    return dry_run(at_two_points(**SEED))


def test_the_result_is_that_of_a_campaign(result, campaign, two_points):
    outlook = two_points.forecast(campaign[-1].state)
    assert result.robots == 1
    assert result.points == 2
    assert 12 <= result.records <= 16
    assert result.outside == 0
    assert outlook.now_mm / 4.0 < result.worst_sigma_mm < 4.0 * outlook.now_mm


def test_systematic_effects_widen_the_expanded_uncertainty(result):
    plan = at_two_points(**SEED)
    stated = plan.settings.model_copy(update={"uncertainty": UncertaintySettings(grade="ordinary")})
    machine = replace(plan.robot, effects=stated_effects(stated))
    wider = dry_run(replace(plan, settings=stated, robot=machine))
    assert wider.records == result.records
    assert wider.worst_sigma_mm == result.worst_sigma_mm < result.expanded_mm < wider.expanded_mm


def test_minutes_are_of_everything_that_is_measured(result):
    """Held-out poses are reached on straight lines."""
    plan = at_two_points(**SEED)
    timing, move_s = plan.settings.timing, usual_move_seconds(plan.settings)
    poses = 3 * (6 + 1) + 3 * (6 + 5 + 1)
    held_out = poses * (move_s + timing.window_s) / 60.0
    noise = (
        40 * 0.1 + (14 + 1 + 6) * move_s + (14 + 6) * 0.6
    ) / 60.0  # to pilot poses, once beside, and back
    records = plan.budget.time_model.minutes(result.records, 2)
    assert result.minutes == pytest.approx(noise + records + held_out)


def test_robots_that_cannot_be_measured_do_not_count():
    plan = at_two_points(**SEED, tolerances__S_mm=200.0)
    found = dry_run(plan)
    assert found.robots == 0
    assert found.drawn == 6
    assert found.worst_sigma_mm is None


def test_a_robot_calibrated_before_is_near_what_its_controller_has(make_plan, paper):
    plan = make_plan()
    controller = hexaglide_geometry(paper.actual["S"], paper.actual["B"], paper.actual["l"])
    robot = make_robot(plan.settings, ControllerGeometry(controller, paper.branch))
    centre = robot.belief().controller.vector
    drawn = robots_within_tolerances(robot, 16, seed=3)
    lengths = np.array([one.vector - centre for one in drawn])[:, -6:]
    assert 0.5 < np.abs(lengths).max() <= 0.7
