"""A plan that starts from an earlier result, carried out on a virtual robot drawn from what is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexacell.campaign.budget import noise_minutes
from hexacell.campaign.planner import Plan
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.identification.problem.problem import Prior
from hexacell.robot.virtual_robot import VirtualRobot

MOST_TRIED = 3
"""Robots, where one cannot be measured."""


def on_expected_robot(plan: Plan, expected: Prior, number: int) -> VirtualCampaign:
    """The campaign on the ``number``-th robot drawn from what is ``expected``, with its drift.

    Raises:
        HexacellError: that robot cannot be measured.
    """
    plan = replace(plan, with_forecast=False)
    random = np.random.default_rng([plan.settings.identification.seed, number])
    step = np.linalg.cholesky(expected.covariance) @ random.standard_normal(len(expected.free))
    truth = plan.robot.mechanism.convention.geometry(expected.free + step)
    campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, truth, random))
    campaign.carry_out()
    return campaign


def minutes_of(campaign: VirtualCampaign) -> float:
    """How long its records take, the look at the noise included, held-out poses not."""
    plan = campaign.plan
    measuring = plan.budget.time_model.minutes(len(campaign.measurements), campaign.state.begun_points)
    return noise_minutes(plan.settings, pilots=0) + measuring
