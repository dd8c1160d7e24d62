"""What measuring costs, and how much of it may be spent."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hexacell.cell.model import CellSettings

MOVES = 4.7
MOVES_LENT = 1.9
"""A record chosen, on the average of six random robots with 55 records each."""


@dataclass(frozen=True, slots=True)
class TimeModel:
    """How long things take: minutes to bring the gauges to a point, seconds to move and settle."""

    point_minutes: float
    record_seconds: float

    @classmethod
    def of(cls, settings: CellSettings, moves: float | None = None) -> TimeModel:
        """The pace that a cell file states, with so many ``moves`` a record, or as they are chosen."""
        by_hand = settings.stations.placement == "by-hand"
        stated = settings.identification.seconds_per_record
        moves = _moves_a_record(settings) if moves is None else moves
        usual = moves * settings.timing.move_s + settings.timing.window_s
        return cls(settings.identification.minutes_per_station if by_hand else 0.0, stated or usual)

    def minutes(self, records: int, stations: int) -> float:
        """Of some records at some points; at its end each point's reference is read once more."""
        return stations * self.point_minutes + (records + stations) * self.record_seconds / 60.0


def _moves_a_record(settings: CellSettings) -> float:
    """Stops on the way included; most are needed because the controller's own geometry is wrong."""
    if settings.identification.poses is not None:
        return 1.0
    return MOVES_LENT if settings.identification.provisional else MOVES


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be spent; without a limit where a number is none."""

    records: int | None
    minutes: float | None
    time_model: TimeModel

    @classmethod
    def of(cls, settings: CellSettings) -> Budget:
        """The budget that a cell file states."""
        plan = settings.identification
        return cls(plan.budget_records, plan.budget_minutes, TimeModel.of(settings))

    def records_left(self, records: int, stations: int) -> float:
        """How many more records can be paid after some records at some points; infinite if all."""
        left = math.inf if self.records is None else float(self.records - records)
        if self.minutes is not None:
            seconds = 60.0 * (self.minutes - self.time_model.minutes(records, stations))
            left = min(left, math.floor(seconds / self.time_model.record_seconds + 1e-9))
        return max(left, 0.0)

    @property
    def description(self) -> str:
        """The limits for people."""
        limits = []
        if self.records is not None:
            limits.append(f"{self.records} records")
        if self.minutes is not None:
            limits.append(f"{self.minutes:g} minutes")
        return " or ".join(limits)
