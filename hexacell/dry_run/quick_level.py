"""The quick level carried out on a virtual robot that drifted as stated: before anything moves."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.checks.quick_level import QuickAccuracy, QuickLevel
from hexacell.dry_run.campaign import VisitedPose
from hexacell.dry_run.expected_robot import MOST_TRIED, minutes_of, on_expected_robot
from hexacell.errors import HexacellError


@dataclass(frozen=True, slots=True)
class QuickTrial:
    """What the quick level gives.

    Attributes:
        accuracy: none where no robot could be measured.
        points: at which is measured.
        minutes: to measure there, without held-out poses.
        visited: the poses in their order.
    """

    accuracy: QuickAccuracy | None
    points: int = 0
    minutes: float = 0.0
    visited: tuple[VisitedPose, ...] = ()


def try_quick_level(quick: QuickLevel) -> QuickTrial:
    """Carry the quick level out on a robot drawn from what is known; takes a second or two."""
    for number in range(MOST_TRIED):
        try:
            campaign = on_expected_robot(quick.plan, quick.expected, number)
            return QuickTrial(
                quick.accuracy(campaign.measurements),
                campaign.state.begun_points,
                minutes_of(campaign),
                campaign.visited,
            )
        except HexacellError:
            continue
    return QuickTrial(None)
