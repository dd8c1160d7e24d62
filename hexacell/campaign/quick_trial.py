"""The quick level carried out on a virtual robot that drifted as stated: before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.budget import noise_minutes
from hexacell.campaign.dry_run import VirtualCampaign
from hexacell.campaign.quick_level import QuickAccuracy, QuickLevel
from hexacell.errors import HexacellError
from hexacell.kinematics.geometry import Geometry
from hexacell.virtual_robot import VirtualRobot

MOST_TRIED = 3


@dataclass(frozen=True, slots=True)
class QuickTrial:
    """What the quick level gives.

    Attributes:
        accuracy: none where no robot could be measured.
        points: at which is measured.
        minutes: to measure there, without held-out poses.
    """

    accuracy: QuickAccuracy | None
    points: int = 0
    minutes: float = 0.0


def try_quick_level(quick: QuickLevel) -> QuickTrial:
    """Carry the quick level out on a robot drawn from what is known; takes a second or two."""
    for number in range(MOST_TRIED):
        try:
            return _carried_out(quick, number)
        except HexacellError:
            continue
    return QuickTrial(None)


def _carried_out(quick: QuickLevel, number: int) -> QuickTrial:
    """On one robot; raises ``HexacellError`` where that cannot be measured."""
    plan = replace(quick.plan, with_forecast=False)
    random = np.random.default_rng([plan.settings.identification.seed, number])
    campaign = VirtualCampaign(plan, VirtualRobot(plan.robot, _drifted(quick, random), random))
    campaign.carry_out()
    measured, points = campaign.measurements, campaign.state.begun_points
    minutes = noise_minutes(plan.settings) + plan.budget.time_model.minutes(len(measured), points)
    return QuickTrial(quick.accuracy(measured), points, minutes)


def _drifted(quick: QuickLevel, random: np.random.Generator) -> Geometry:
    """A geometry drawn from the result before, with its uncertainty and the stated drift."""
    prior, convention = quick.expected, quick.plan.robot.mechanism.convention
    step = np.linalg.cholesky(prior.covariance) @ random.standard_normal(len(prior.free))
    return convention.geometry(prior.free + step)
