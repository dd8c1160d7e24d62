"""A quick level carried out on a virtual robot that drifted as stated, before anything moves."""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.budget import noise_minutes
from hexacell.checks.quick_level import QuickAccuracy, QuickLevel
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import HexacellError
from hexacell.robot.virtual_robot import VirtualRobot

MOST_TRIED = 3
"""Number of robots that are tried, where one cannot be measured."""


@dataclass(frozen=True, slots=True)
class QuickTrial:
    """What the quick level gives.

    Attributes:
        accuracy: None where no robot could be measured.
        minutes: time to measure there, without held-out poses.
    """

    accuracy: QuickAccuracy | None
    points: int = 0
    minutes: float = 0.0


def try_quick_level(quick: QuickLevel) -> QuickTrial:
    """Carry the quick level out on a robot drawn from what is known; takes a second or two."""
    plan, expected = replace(quick.plan, with_forecast=False), quick.expected
    root = np.linalg.cholesky(expected.covariance)
    for number in range(MOST_TRIED):
        random = np.random.default_rng([plan.settings.identification.seed, number])
        free = expected.free + root @ random.standard_normal(len(expected.free))
        truth = plan.robot.mechanism.convention.geometry(free)
        campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, truth, random))
        try:
            campaign.carry_out()
            accuracy = quick.accuracy(campaign.measurements)
        except HexacellError:
            continue
        points = campaign.state.begun_points
        minutes = plan.budget.time_model.minutes(len(campaign.measurements), points)
        return QuickTrial(accuracy, points, noise_minutes(plan.settings, pilots=0) + minutes)
    return QuickTrial(None)
