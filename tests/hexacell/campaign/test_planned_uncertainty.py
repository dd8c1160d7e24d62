"""What the systematic effects will make of a plan's result, before anything is measured."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import planned_systematic_mm
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.pose import Pose
from hexacell.robot.virtual_robot import VirtualRobot, exact_records

THREE_POINTS = ((0.0, -200.0, 550.0), (100.0, -100.0, 500.0), (-100.0, 100.0, 500.0))


@pytest.fixture(scope="module")
def ordinary(make_plan):
    """The plan of a machine with the effects of an ordinary one."""
    plan = make_plan(identification__points=THREE_POINTS)
    uncertainty = UncertaintySettings(grade="ordinary")
    settings = plan.settings.model_copy(update={"uncertainty": uncertainty})
    return replace(plan, settings=settings, robot=plan.robot.with_errors_of(settings))


def test_exact_records_are_those_of_a_virtual_robot_without_errors_and_noise(make_plan) -> None:
    robot = make_plan().robot
    silent = replace(robot, noise=replace(robot.noise, encoder=0.0, gauge_mm=0.0))
    commands = [Pose(100.0, -100.0, 500.0), Pose(101.0, -100.0, 499.0, 5.0, -8.0, 12.0)]
    virtual = VirtualRobot(silent, robot.commanding)
    measured = []
    for orientation, command in enumerate(commands, start=1):
        virtual.place(command)
        measured.append(virtual.measure(2, orientation))
    found = [*exact_records(robot, 2, robot.from_commands(commands))]
    assert [one.id for one in found] == [(2, 1), (2, 2)]
    for one, expected in zip(found, measured, strict=True):
        assert one.pose.as_tuple() == pytest.approx(expected.pose.as_tuple(), abs=1e-9)
        assert one.joints == pytest.approx(expected.joints, abs=1e-6)
        assert one.deviation == pytest.approx(expected.deviation, abs=1e-6)


def test_it_is_that_of_a_campaign_that_was_carried_out(ordinary, paper) -> None:
    """The planned poses are not those that are chosen, so that it is only about the same."""
    campaign = VirtualCampaign(
        ordinary, VirtualRobot(ordinary.robot, paper.actual, np.random.default_rng(2))
    )
    campaign.carry_out()
    estimate = ordinary.estimate(campaign.state)
    budget = ordinary.task.budget(estimate.identification, estimate.belief, ordinary.robot.effects)
    assert ordinary.systematic_mm == pytest.approx(budget.systematic_mm, rel=0.4)
    forecast = ordinary.forecast(campaign.state)
    assert forecast.systematic_mm == ordinary.systematic_mm
    expanded = 2.0 * np.hypot(forecast.now_mm, ordinary.systematic_mm)
    assert forecast.expanded_mm(forecast.now_mm) == pytest.approx(expanded)
    assert forecast.expanded_mm(forecast.now_mm) == pytest.approx(budget.expanded_mm, rel=0.4)


def test_an_earlier_result_shares_its_constant_effects(ordinary) -> None:
    """A prior that had the effects as well, and is much better known than the records make it."""
    sets, task = ordinary.planned_sets, ordinary.task
    alone = planned_systematic_mm(ordinary.robot, task, sets)
    known = replace(ordinary.robot.prior, covariance=1e-6 * ordinary.robot.prior.covariance)
    robot = replace(ordinary.robot, known=known)
    zero = np.zeros((35, 6))
    unaware = planned_systematic_mm(robot, task, sets, {"scale of each encoder": zero})
    aware = planned_systematic_mm(robot, task, sets, {"scale of each encoder": zero + 1e-3})
    assert None not in {alone, unaware, aware}
    assert aware != pytest.approx(unaware, rel=0.01)


def test_a_task_that_nobody_reaches_has_no_uncertainty(ordinary) -> None:
    far = replace(ordinary.task, poses=ordinary.robot.from_commands([Pose(0.0, 0.0, 5000.0)]))
    assert planned_systematic_mm(ordinary.robot, far, ordinary.planned_sets) is None
