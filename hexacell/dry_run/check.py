"""A check carried out on a virtual robot that drifted as stated: before anything moves."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.checks.check import Check
from hexacell.dry_run.campaign import VisitedPose
from hexacell.dry_run.expected_robot import MOST_TRIED, minutes_of, on_expected_robot
from hexacell.errors import HexacellError


@dataclass(frozen=True, slots=True)
class CheckTrial:
    """What a check takes and gives; no records where no robot could be measured.

    Attributes:
        points: at which is measured.
        minutes: to measure there.
        error_mm: predicted at the worst task pose afterwards, 1 sigma; none without reachable task poses.
        visited: the poses in their order.
    """

    records: int = 0
    points: int = 0
    minutes: float = 0.0
    error_mm: float | None = None
    visited: tuple[VisitedPose, ...] = ()


def try_check(check: Check) -> CheckTrial:
    """Carry a check out on a robot drawn from what is known; takes a second or two."""
    expected = check.robot.prior if check.before is None else check.before.prior(1.0)
    for number in range(MOST_TRIED):
        try:
            campaign = on_expected_robot(check.plan, expected, number)
            error = check.predicted_error(campaign.measurements)
        except HexacellError:
            continue
        return CheckTrial(
            len(campaign.measurements),
            campaign.state.begun_points,
            minutes_of(campaign),
            error,
            campaign.visited,
        )
    return CheckTrial()
