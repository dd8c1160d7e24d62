"""The state of a campaign of measurements, and the decisions that are made on it."""

from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from typing import Literal

from hexacell.campaign.pilots import with_pilots
from hexacell.cell.fields import Frozen
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import Deviation, Joints, MeasurementSet, Record
from hexacell.uncertainty.statement import COVERAGE_FACTOR


@dataclass(frozen=True)
class CampaignState:
    """All that a decision depends on.

    Attributes:
        measurements: the records so far, in the order they were measured.
        point: the point at which the gauges are, counted from 1; None between points.
        done: points that are not to be measured any more.
        present: the pose last commanded, in the controller's frames; None if it is not known.
        rejections: records of the present point that could not be taken.
        zero_mm: what the gauges showed along base x, y, z when they were zeroed there; None if that
            is not known.
        pilots: records that only steer the choice of poses.
    """

    measurements: MeasurementSet = field(default_factory=lambda: MeasurementSet(()))
    point: int | None = None
    done: frozenset[int] = frozenset()
    present: Pose | None = None
    rejections: int = 0
    zero_mm: Deviation | None = None
    pilots: tuple[Record, ...] = ()

    @cached_property
    def steering(self) -> MeasurementSet:
        """All records that poses are chosen by, pilot records included."""
        return with_pilots(self.measurements, self.pilots)

    def records_at(self, point: int) -> int:
        """How many records a point has."""
        return self.measurements.counts.get(point, 0)

    @property
    def begun_points(self) -> int:
        """How many points have been begun, the present one included."""
        return len({*self.measurements.counts, self.point} - {None})


class Forecast(Frozen):
    """The predicted error at the worst task pose, 1 sigma, mm: now, after this record, at the end.

    Attributes:
        now_mm: error by the records so far.
        next_mm: error with the proposed record.
        end_mm: error once everything that is still planned is measured.
        records: number of records still planned, the proposed one included, and the ``minutes`` of them.
        systematic_mm: standard uncertainty by the systematic effects there, at the end; None where it is
            not known.
    """

    now_mm: float
    next_mm: float
    end_mm: float
    records: int
    minutes: float
    systematic_mm: float | None = None

    def expanded_mm(self, error_mm: float) -> float | None:
        """U (k = 2) for one of the predicted errors; None where the systematic effects are not known."""
        return None if self.systematic_mm is None else COVERAGE_FACTOR * hypot(error_mm, self.systematic_mm)

    @property
    def gain_mm(self) -> float:
        """The reduction of the error by completing the plan."""
        return self.now_mm - self.end_mm


@dataclass(frozen=True, slots=True)
class StartPoint:
    """Begin a point: go to its pose, in the controller's frames, by these joints; zero the gauges."""

    point: int
    pose: Pose
    joints: Joints
    orientation: Literal[1] = 1


@dataclass(frozen=True, slots=True)
class MeasurePose:
    """Measure the present point in one more orientation.

    Attributes:
        orientation: counted from 1; the reference is the first.
        pose: what to command, in the controller's frames.
        joints: joint variables that the controller will go to, mm.
        deviation: what the gauges should show, mm along base x, y, z, and ``sigma``.
        gain: information on the parameters, nat.
        forecast: None where there are no task poses to predict errors at.
        via: poses to pass on the path without measuring, in the controller's frames.
    """

    point: int
    orientation: int
    pose: Pose
    joints: Joints
    deviation: Deviation
    sigma: Deviation
    gain: float
    forecast: Forecast | None
    via: tuple[Pose, ...] = ()


@dataclass(frozen=True, slots=True)
class FinishPoint:
    """Nothing more is to be measured at the present point, and why."""

    point: int
    reason: str


@dataclass(frozen=True, slots=True)
class Finished:
    """Nothing more is to be measured, and why."""

    reason: str


Decision = StartPoint | MeasurePose | FinishPoint | Finished
