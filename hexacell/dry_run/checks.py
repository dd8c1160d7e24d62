"""A quick level carried out on a virtual robot that drifted as stated, before anything moves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.budget import noise_minutes
from hexacell.campaign.planner import Plan
from hexacell.checks.quick_level import QuickAccuracy, QuickLevel
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import HexacellError
from hexacell.identification.problem.prior import Prior
from hexacell.robot.virtual_robot import VirtualRobot

MOST_TRIED = 3
"""Number of robots that are tried, where one cannot be measured."""


@dataclass(frozen=True, slots=True)
class QuickTrial:
    """What the quick level gives.

    Attributes:
        accuracy: None where no robot could be measured.
        points: number of points at which is measured.
        minutes: time to measure there, without held-out poses.
    """

    accuracy: QuickAccuracy | None
    points: int = 0
    minutes: float = 0.0


def try_quick_level(quick: QuickLevel) -> QuickTrial:
    """Carry the quick level out on a robot drawn from what is known; takes a second or two."""
    for campaign in _on_expected_robots(quick.plan, quick.expected):
        with suppress(HexacellError):
            return QuickTrial(
                quick.accuracy(campaign.measurements),
                campaign.state.begun_points,
                _minutes_of(campaign),
            )
    return QuickTrial(None)


def _on_expected_robots(plan: Plan, expected: Prior) -> Iterator[VirtualCampaign]:
    """The campaigns on some robots drawn from what is ``expected``, of those that can be measured."""
    plan = replace(plan, with_forecast=False)
    root = np.linalg.cholesky(expected.covariance)
    for number in range(MOST_TRIED):
        random = np.random.default_rng([plan.settings.identification.seed, number])
        free = expected.free + root @ random.standard_normal(len(expected.free))
        truth = plan.robot.mechanism.convention.geometry(free)
        campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, truth, random))
        try:
            campaign.carry_out()
        except HexacellError:
            continue
        yield campaign


def _minutes_of(campaign: VirtualCampaign) -> float:
    """How long its records take, measuring the noise included, held-out poses not."""
    plan = campaign.plan
    measuring = plan.budget.time_model.minutes(len(campaign.measurements), campaign.state.begun_points)
    return noise_minutes(plan.settings, pilots=0) + measuring
