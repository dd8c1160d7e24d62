"""What measuring costs in records and time, and how much of it may be spent."""

import math
from collections.abc import Mapping, Set
from dataclasses import dataclass

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.time_model import TimeModel, seconds_beside
from hexacell.cell.measuring import MOST_RECORDS
from hexacell.cell.model import CellSettings

MOST_SHARE = 2
"""Most records at a point, in multiples of its plan: they hardly take the place of another point."""


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be spent on a run; without a limit where a number is None.

    Of the ``minutes`` some are ``reserved`` for what it does beside the identification.
    """

    records: int | None
    minutes: float | None
    reserved: float = 0.0

    @classmethod
    def of(cls, settings: CellSettings) -> "Budget":
        """The budget that a cell file states."""
        plan = settings.identification
        reserved = 0.0 if plan.budget_minutes is None else sum(seconds_beside(settings).values()) / 60.0
        return cls(plan.budget_records, plan.budget_minutes, reserved)

    def records_left(self, records: int, points: int, times: TimeModel) -> float:
        """How many more records can be paid after some records at some points; infinite if all."""
        left = math.inf if self.records is None else float(self.records - records)
        if self.minutes is not None:
            seconds = 60.0 * (self.minutes - self.reserved - times.minutes(records, points))
            left = min(left, math.floor(seconds / times.record_s + 1e-9))
        return max(left, 0.0)

    @property
    def description(self) -> str:
        """The limits in words."""
        records = [] if self.records is None else [f"{self.records} records"]
        minutes = [] if self.minutes is None else [f"{self.minutes:g} minutes"]
        return " or ".join(records + minutes)


def shared_sizes(planned: Mapping[int, int], state: CampaignState, left: Set[int]) -> dict[int, int]:
    """How many records each point gets at most, so that all points together get as many as ``planned``.

    No point gets fewer than planned, though another one had more while this one seemed out of reach,
    and none more than ``MOST_SHARE`` times as many. Beside the points that are done, whether they got their
    records or not, those ``left`` cannot be measured as far as is known.
    """
    waiting = set(planned) - state.done - left
    if not waiting:
        return dict(planned)
    missing = sum(size - state.records_at(point) for point, size in planned.items() if point not in waiting)
    share = max(0, missing // len(waiting))
    return {
        point: min(size + share, MOST_SHARE * size) if point in waiting else size
        for point, size in planned.items()
    }


def paid_sizes(
    planned: Mapping[int, int], state: CampaignState, left: Set[int], budget: Budget, times: TimeModel
) -> dict[int, int]:
    """How many records each point gets that the minutes of a budget pay for, the same number at each.

    Those that are done keep what they have, and so do, at their plan, those ``left`` as out of reach.
    """
    waiting = set(planned) - state.done - left
    if not waiting:
        return dict(planned)
    begun = state.begun_points + len(waiting - {state.point} - set(state.measurements.counts))
    paid = budget.records_left(len(state.measurements), begun, times)
    paid += sum(state.records_at(point) for point in waiting)
    each = max(2, int(min(paid, MOST_RECORDS) / len(waiting)))
    return {point: each if point in waiting else size for point, size in planned.items()}
