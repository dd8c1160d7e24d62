"""What measuring costs in records and time, and how much of it may be spent."""

import math
from collections.abc import Mapping, Set
from dataclasses import dataclass

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.pilots import pilots_per_departure
from hexacell.cell.limits import SpeedSettings
from hexacell.cell.model import CellSettings
from hexacell.kinematics.parameters import JointUnit
from hexacell.motion.trajectory import SpeedLimits


@dataclass(frozen=True, slots=True)
class UsualMoves:
    """What a selected record takes: means over six random robots with 55 records each.

    Attributes:
        moves: number of moves, waypoints and ways back included.
        joint_mm, edge_mm: how far the fastest joint and the fastest point of the platform would come at
            their largest speed for the duration of a move.
    """

    moves: float
    joint_mm: float
    edge_mm: float


COMMANDED = UsualMoves(3.3, 48.0, 48.0)
"""Most waypoints are needed because the controller commands with its own, wrong geometry."""

COMMANDED_PROVISIONALLY = UsualMoves(1.3, 166.0, 124.0)

MOST_SHARE = 2
"""Most records at a point, in multiples of its plan: they hardly take the place of another point."""

MOVE_OVERHEAD_S = 0.3
"""Time of a move to speed up, to slow down, and to be acknowledged."""


@dataclass(frozen=True, slots=True)
class TimeModel:
    """Durations: minutes to bring the gauges to a point, seconds to move and settle for a record."""

    point_minutes: float
    record_seconds: float

    @classmethod
    def of(cls, settings: CellSettings, moves: float | None = None) -> "TimeModel":
        """The durations that a cell file states, with ``moves`` a record, or as many as usual."""
        by_hand = settings.stations.placement == "by-hand"
        stated = settings.identification.seconds_per_record
        if moves is None:
            moves = 1.0 if settings.identification.poses is not None else _usual(settings).moves
        usual = moves * usual_move_seconds(settings) + settings.timing.window_s
        return cls(settings.identification.minutes_per_station if by_hand else 0.0, stated or usual)

    def minutes(self, records: int, points: int) -> float:
        """Time for some records at some points; at its end each point's reference is read once more."""
        return points * self.point_minutes + (records + points) * self.record_seconds / 60.0


def speed_limits(settings: SpeedSettings, *, at_gauges: bool) -> SpeedLimits:
    """The largest speeds of a move that begins or ends with gauges at the ball, or of one without."""
    if at_gauges:
        return SpeedLimits(settings.joint_at_gauges, settings.edge_at_gauges_mm_s)
    return SpeedLimits(settings.joint, settings.edge_mm_s)


def usual_move_seconds(settings: CellSettings) -> float:
    """Duration of a move between poses with gauges at the ball, as stated or by its largest speeds."""
    if settings.timing.move_s is not None:
        return settings.timing.move_s
    limits, usual = speed_limits(settings.speed, at_gauges=True), _usual(settings)
    by_edge = usual.edge_mm / limits.edge_mm_s
    if settings.mechanism.words.joint_unit is not JointUnit.MM:
        return MOVE_OVERHEAD_S + by_edge  # how far such joints turn depends on their size
    return MOVE_OVERHEAD_S + max(usual.joint_mm / limits.joint, by_edge)


def noise_minutes(settings: CellSettings, pilots: int) -> float:
    """To measure the noise at the first reference: readings at rest, then leaving it and coming back.

    Some departures are for ``pilots``, poses at which the gauges are read.
    """
    noise, timing = settings.noise, settings.timing
    for_pilots = math.ceil(pilots / pilots_per_departure(settings.identification.poses is not None))
    departures = pilots + max(0, noise.revisits - for_pilots)
    moves = (departures + noise.revisits) * usual_move_seconds(settings)
    windows = (noise.revisits + pilots) * timing.window_s
    return (noise.standstill_readings * timing.interval_s + moves + windows) / 60.0


def _usual(settings: CellSettings) -> UsualMoves:
    return COMMANDED_PROVISIONALLY if settings.identification.provisional else COMMANDED


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be spent; without a limit where a number is None."""

    records: int | None
    minutes: float | None
    time_model: TimeModel

    @classmethod
    def of(cls, settings: CellSettings) -> "Budget":
        """The budget that a cell file states."""
        plan = settings.identification
        return cls(plan.budget_records, plan.budget_minutes, TimeModel.of(settings))

    def records_left(self, records: int, points: int) -> float:
        """How many more records can be paid after some records at some points; infinite if all."""
        left = math.inf if self.records is None else float(self.records - records)
        if self.minutes is not None:
            seconds = 60.0 * (self.minutes - self.time_model.minutes(records, points))
            left = min(left, math.floor(seconds / self.time_model.record_seconds + 1e-9))
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
