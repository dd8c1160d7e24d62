"""How long a run takes: by the speeds, the windows and the people's time that a cell file states.

What a record takes is not stated: poses are chosen for what they tell in a second. Before any is measured
it is what a usual turn of the platform takes; then the ways between the records tell it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np

from hexacell.cell.limits import SpeedSettings
from hexacell.cell.model import CellSettings
from hexacell.design.candidates import ReachableTargets
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.commanded_motion import ActualPoses
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Record
from hexacell.motion.durations import SpeedLimits, approximate_durations, line_durations
from hexacell.motion.trajectory import PIECES
from hexacell.robot.model import Robot


@dataclass(frozen=True, slots=True)
class Overheads:
    """What the steps of a run take beside what the cell file tells.

    Attributes:
        move_s: of a move, to speed up, to slow down, and to be acknowledged.
        reading_s: of a reading beside its window: all devices are asked before, and answer at last.
        place_s: for a person to bring the gauges to a point; None: as the cell file states.
    """

    move_s: float = 0.3
    reading_s: float = 0.35
    place_s: float | None = None


USUAL = Overheads()
"""Means over the bundled cells, for a cell of which no run tells."""

USUAL_TURN, OF_RECORDS = 0.31, 11
"""How far the platform turns for a record where a point has so many, rad, waypoints included: the mean in
the bundled cells. With more of them they are nearer to each other."""

WIDE_SHARE = 0.65
"""How far it turns from one held-out pose to the next, in multiples of the largest tilt."""

ENOUGH_RECORDS = 8
"""So many records tell how long the next ones take."""

TRIAL_MOVES, TRIAL_READINGS = 4, 3
"""To try the gauges of a set: along each axis, and back."""


class TimeKind(StrEnum):
    """What the time of a run is spent on."""

    MOVING = "moving"
    READING = "reading"
    SETTLING = "settling"
    DECIDING = "deciding"
    ASKING = "asking"
    PLACING = "placing gauges"


Seconds = dict[TimeKind, float]
"""How long was spent on each, s."""


def no_seconds() -> Seconds:
    """Nothing of any kind."""
    return dict.fromkeys(TimeKind, 0.0)


def speed_limits(settings: SpeedSettings, *, at_gauges: bool) -> SpeedLimits:
    """The largest speeds of a move that begins or ends with gauges at the ball, or of one without."""
    if at_gauges:
        return SpeedLimits(settings.joint_at_gauges, settings.edge_at_gauges_mm_s)
    return SpeedLimits(settings.joint, settings.edge_mm_s)


@dataclass(frozen=True, slots=True)
class TimeModel:
    """Durations in a cell.

    Attributes:
        place_s: for a person to bring the gauges to a point.
        trial_s: to try them there; 0 where they are fixed, which are tried once.
        station_s: for that, to go there, and to come back to its reference in the end.
        reading_s: to read a record, once the robot stands still.
        move_s: to go to its pose; ``wide_move_s`` from one held-out pose to the next.
        speeds: the largest speeds with gauges at the ball.
        overheads: what they were computed with.
    """

    place_s: float
    trial_s: float
    station_s: float
    reading_s: float
    move_s: float
    wide_move_s: float
    speeds: SpeedLimits
    overheads: Overheads

    @classmethod
    def of(cls, settings: CellSettings, overheads: Overheads = USUAL) -> "TimeModel":
        """The durations before anything is measured."""
        reading_s = settings.timing.window_s + overheads.reading_s
        is_by_hand = settings.stations.placement == "by-hand"
        speeds = speed_limits(settings.speed, at_gauges=True)
        between = speed_limits(settings.speed, at_gauges=not is_by_hand)
        radius = float(settings.mechanism.platform_radius(settings.drawing))
        usual = USUAL_TURN * (OF_RECORDS / settings.identification.orientations) ** 0.5
        wide = WIDE_SHARE * float(np.radians(settings.limits.tilt_deg))
        move_s, wide_move_s = (
            overheads.move_s + _seconds(settings, turn * radius, speeds) for turn in (usual, wide)
        )
        points = np.array(settings.identification.points)[:, :3]
        apart_mm = float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
        trial_s = _trial_seconds(settings, overheads) if is_by_hand else 0.0
        station_s = (
            trial_s + overheads.move_s + _seconds(settings, apart_mm, between) + wide_move_s + reading_s
        )
        stated_s = 60.0 * settings.identification.minutes_per_station
        place_s = stated_s if overheads.place_s is None else overheads.place_s
        place_s = place_s if is_by_hand else 0.0
        return cls(place_s, trial_s, station_s, reading_s, move_s, wide_move_s, speeds, overheads)

    def after(self, robot: Robot, records: Sequence[Record]) -> "TimeModel":
        """These durations, the next moves being as the ways between the records, if there are enough."""
        pairs = [(one, other) for one, other in pairwise(records) if one.point == other.point]
        if len(pairs) < ENOUGH_RECORDS:
            return self
        starts, ends = (
            robot.from_commands(record.pose for record in side) for side in zip(*pairs, strict=True)
        )
        of_robot = robot.mechanism, robot.controller, robot.branch
        ways = line_durations(*of_robot, starts, ends, self.speeds, PIECES)
        return replace(self, move_s=self.overheads.move_s + float(ways.mean()))

    def between_held_out(self, robot: Robot, sets: Sequence[PoseBatch]) -> "TimeModel":
        """These durations, held-out poses being the sets, each in its order, its reference first."""
        pairs = [(one[:-1], one[1:]) for one in sets]
        starts, ends = (PoseBatch.joined([pair[side] for pair in pairs]) for side in (0, 1))
        robot_of = robot.mechanism, robot.commanding, robot.branch
        ways = line_durations(*robot_of, starts, ends, self.speeds, PIECES)
        wide_move_s = self.overheads.move_s + float(np.nanmean(ways))
        station_s = self.station_s + wide_move_s - self.wide_move_s  # the way back is as wide
        return replace(self, wide_move_s=wide_move_s, station_s=station_s)

    @property
    def record_s(self) -> float:
        """To go to the pose of a record, and to read it."""
        return self.move_s + self.reading_s

    def minutes(self, records: int, points: int) -> float:
        """Time for some records at some points, each of which is begun and ended."""
        return (records * self.record_s + points * (self.place_s + self.station_s)) / 60.0

    def seconds_to(self, belief: RobotBelief, start: ActualPoses, targets: ReachableTargets) -> Array:
        """To go from a pose (1) straight to others and to read there (n,)."""
        ends = (start.poses, start.joints), (targets.poses, targets.joints)
        ways = approximate_durations(belief.mechanism, belief.estimate, *ends, self.speeds)
        return np.asarray(ways + self.overheads.move_s + self.reading_s)


def calibration_seconds(settings: CellSettings) -> Seconds:
    """What a calibration takes in all, as far as the cell file tells."""
    times, plan, total = TimeModel.of(settings), settings.identification, seconds_beside(settings)
    points, records = len(plan.points), planned_records(settings)
    total[TimeKind.MOVING] += records * times.move_s + points * times.station_s
    total[TimeKind.READING] += records * times.reading_s
    total[TimeKind.PLACING] += points * times.place_s
    return total


def planned_records(settings: CellSettings) -> int:
    """How many records the points get in all, as far as the cell file tells."""
    times, plan = TimeModel.of(settings), settings.identification
    points = len(plan.points)
    if plan.budget_minutes is None:
        return points * plan.orientations
    left_s = 60.0 * (plan.budget_minutes - times.minutes(0, points)) - sum(
        seconds_beside(settings).values()
    )
    return max(2 * points, int(left_s / times.record_s))


def lost_to_speed(settings: CellSettings) -> float:
    """The minutes that a calibration would take less at twice the speeds with gauges at the ball."""
    speed = settings.speed
    twice = {
        "joint_at_gauges": 2.0 * speed.joint_at_gauges,
        "edge_at_gauges_mm_s": 2.0 * speed.edge_at_gauges_mm_s,
    }
    faster = settings.model_copy(update={"speed": speed.model_copy(update=twice)})
    now, then = (calibration_seconds(one)[TimeKind.MOVING] for one in (settings, faster))
    return (now - then) / 60.0


def seconds_beside(settings: CellSettings, known: TimeModel | None = None) -> Seconds:
    """What a calibration takes beside its identification: the noise, and the held-out points twice.

    ``known``: by these durations, not by those that the cell file tells.
    """
    times, wanted, noise = known or TimeModel.of(settings), settings.verification, settings.noise
    points = len(wanted.points)
    moves, stations = points * (wanted.compared + wanted.afterwards), 2 * points
    standing_s = noise.standstill_readings * settings.timing.interval_s
    visits_s = noise.revisits * times.move_s  # mostly from poses near by
    trial_s = 0.0 if times.trial_s else _trial_seconds(settings, times.overheads)
    return no_seconds() | {
        TimeKind.READING: standing_s + (noise.revisits + moves) * times.reading_s,
        TimeKind.MOVING: trial_s + visits_s + moves * times.wide_move_s + stations * times.station_s,
        TimeKind.PLACING: stations * times.place_s,
    }


def _trial_seconds(settings: CellSettings, overheads: Overheads) -> float:
    """To try the gauges; 0 where they are not."""
    trial_mm, reading_s = settings.stations.trial_mm, settings.timing.window_s + overheads.reading_s
    move_s = overheads.move_s + _seconds(settings, trial_mm, speed_limits(settings.speed, at_gauges=True))
    return TRIAL_MOVES * move_s + TRIAL_READINGS * reading_s if trial_mm else 0.0


def _seconds(settings: CellSettings, way_mm: float, speeds: SpeedLimits) -> float:
    """How long a way of the platform's edge takes, and of joints that are on the way as far."""
    # How far joints turn depends on their size.
    is_linear = settings.mechanism.words.joint_unit is JointUnit.MM
    return way_mm / (min(speeds.edge_mm_s, speeds.joint) if is_linear else speeds.edge_mm_s)
