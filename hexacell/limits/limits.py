"""The limits that commanded motion keeps: of what is commanded, and of where that brings the robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import CONSTRAINTS
from hexacell.kinematics.pose import SAME_FRAMES, FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.limits.gauge_travel import GaugeRoom, GaugeTravel, Three
from hexacell.limits.leg_limits import ROUNDING, LegLimits


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """What the controller's six axes x, y, z, a, b, c may be commanded to: (6,) each, mm and deg."""

    lowest: tuple[float, ...] = (-np.inf,) * 6
    highest: tuple[float, ...] = (np.inf,) * 6

    def including(self, pose: PoseBatch) -> AxisLimits:
        """These limits, widened to allow one pose (1)."""
        numbers = pose.numbers()[0]
        lowest, highest = np.minimum(self.lowest, numbers), np.maximum(self.highest, numbers)
        return AxisLimits(tuple(lowest.tolist()), tuple(highest.tolist()))

    def allow(self, poses: PoseBatch) -> Mask:
        """Which of n poses in the controller's frames."""
        if self == NO_AXIS_LIMITS:
            return np.ones(len(poses), dtype=bool)
        numbers = poses.numbers()
        low, high = np.array(self.lowest) - ROUNDING, np.array(self.highest) + ROUNDING
        return np.asarray(((numbers >= low) & (numbers <= high)).all(axis=-1))


NO_AXIS_LIMITS = AxisLimits()


@dataclass(frozen=True, slots=True, eq=False)
class ZeroedRanges:
    """Ranges (6,) of the joint variables, and of what a controller shows: with the encoders' zeros.

    Attributes:
        lowest, highest: joint variable of each leg.
        lowest_shown, highest_shown: joint variable plus zero, which a calibration changes.
    """

    lowest: Array
    highest: Array
    lowest_shown: Array
    highest_shown: Array

    def at(self, zeros: Array) -> tuple[Array, Array]:
        """Lowest and highest joint variables that both allow, where a controller has these zeros (6,)."""
        return (
            np.maximum(self.lowest, self.lowest_shown - zeros),
            np.minimum(self.highest, self.highest_shown - zeros),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Limits that every commanded pose keeps: mm and rad; the singularity margin is dimensionless.

    Attributes:
        gauge_travel_mm: largest deviation from the zeroed reference.
        tilt: largest angle of the platform's normal from the base's.
        joint_min: smallest joint variable, of every leg or of each (6,).
        joint_max: the largest.
        frames: from the frames of the commands, in which a level platform is level, to the convention's.
        turn: largest turn of the platform about its normal.
        axes: what the controller's axes may be commanded to.
        legs: what passive joints and legs allow; None where that is not known.
        gauges: travels and plungers; without them the ball may go as far to all sides.
        zeroed: the room of the gauges as they were zeroed; None where that is not known yet.
        shown_joints: what joint_min and joint_max follow from, where they depend on the encoders' zeros.
        stands_at: tilt and turn of a robot that stands beyond those limits, which commands still keep.
    """

    gauge_travel_mm: float
    tilt: float
    joint_min: float | Array
    joint_max: float | Array
    singularity_margin: float
    frames: FrameTransform = field(default=SAME_FRAMES)
    turn: float = np.pi
    axes: AxisLimits = NO_AXIS_LIMITS
    legs: LegLimits | None = None
    gauges: GaugeTravel | None = None
    zeroed: GaugeRoom | None = None
    shown_joints: ZeroedRanges | None = None
    stands_at: tuple[float, float] = (0.0, 0.0)

    def with_zeros(self, zeros: Array) -> Limits:
        """These limits where the controller's geometry has some zeros (6,) of the encoders."""
        if self.shown_joints is None:
            return self
        lowest, highest = self.shown_joints.at(zeros)
        return replace(self, joint_min=lowest, joint_max=highest)

    @property
    def room(self) -> GaugeRoom:
        """How far the ball may go from the gauges' zero."""
        if self.zeroed is not None:
            return self.zeroed
        return GaugeRoom.symmetric(self.gauge_travel_mm) if self.gauges is None else self.gauges.room()

    @property
    def travels_mm(self) -> Three:
        """Measuring ranges of the gauges x, y and z; infinite where they are not known."""
        if self.gauges is None:
            return (np.inf, np.inf, np.inf)
        x, y, z = self.gauges.half_mm
        return 2.0 * x, 2.0 * y, 2.0 * z

    def within_travel(self, deviations: Array, spread: Array | float = 0.0, share: float = 1.0) -> Mask:
        """Which deviations (..., 3), mm, in the convention's frames stay within a share of the room.

        The ``spread`` (..., 3) is along the gauges.
        """
        return self.room.holds(deviations @ self.frames.base, spread, share)

    def sigma_along_gauges(self, covariance: Array) -> Array:
        """Standard deviations (..., 3) of what gauges show, by a covariance in the convention."""
        base = self.frames.base
        variances = np.sum((covariance @ base) * base, axis=-2)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))

    def zeroed_at(self, shown_mm: tuple[float, float, float] | None) -> Limits:
        """These limits once the gauges were zeroed where they show ``shown_mm`` along base x, y, z."""
        if self.gauges is None or shown_mm is None:
            return self
        return replace(self, zeroed=self.gauges.room(shown_mm))

    def surely_zeroed(self) -> Limits:
        """These limits wherever the gauges' plungers will stand, if they are mounted well enough."""
        return self if self.gauges is None else replace(self, zeroed=self.gauges.sure_room)

    @property
    def joint_ranges(self) -> tuple[tuple[float, float], ...]:
        """Smallest and largest joint variable of each leg, mm."""
        of_each = max(np.size(self.joint_min), np.size(self.joint_max))
        legs = of_each if of_each > 1 else CONSTRAINTS
        lowest, highest = (np.broadcast_to(limit, legs) for limit in (self.joint_min, self.joint_max))
        return tuple(zip(lowest.tolist(), highest.tolist(), strict=True))

    def orientations(self, turns: Array) -> Array:
        """Turns (n, 3, 3) of a level platform, as orientations in the convention's frames."""
        return self.frames.base @ turns @ self.frames.platform.T

    def allow_commands(self, poses: PoseBatch) -> Mask:
        """Which of n commands in the convention's frames keep tilt, turn and axes."""
        commands = self.frames.inverse().poses(poses)
        return self.axes.allow(commands) & _are_within(commands, self.tilt, self.turn)

    def allow_joints(self, joints: Array) -> Mask:
        """Which joint variables (..., 6), mm, are in their ranges; NaN is not."""
        in_range = (joints >= self.joint_min) & (joints <= self.joint_max)
        return np.asarray(in_range.all(axis=-1))

    def allow_poses(self, poses: PoseBatch, joints: Array) -> Mask:
        """Which of n poses of the robot itself keep tilt, turn and joint ranges."""
        at = self.frames.inverse().poses(poses)
        largest = max(self.tilt, self.stands_at[0]), max(self.turn, self.stands_at[1])
        return self.allow_joints(joints) & _are_within(at, *largest)

    def allow_legs(
        self,
        mechanism: Mechanism,
        geometry: Geometries,
        poses: PoseBatch,
        joints: Array,
        wanted: Array | float = 0.0,
    ) -> Mask:
        """At which of n poses a robot's passive joints and legs keep their limits, with margins (m,)."""
        if self.legs is None:
            return np.ones(len(joints), dtype=bool)
        return self.legs.keeps(mechanism.legs(geometry, poses, joints), wanted)

    def leg_margins(
        self, mechanism: Mechanism, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> Array:
        """By how much passive joints and legs keep their limits at n poses: (n, m), m = 0 without limits.

        See :meth:`LegLimits.margins <hexacell.limits.leg_limits.LegLimits.margins>`.
        """
        if self.legs is None:
            return np.zeros((len(joints), 0))
        return self.legs.margins(mechanism.legs(geometry, poses, joints))

    def including(
        self,
        mechanism: Mechanism,
        geometry: Geometry,
        command: PoseBatch,
        actual: PoseBatch,
        joints: Array,
        wanted: Array | float = 0.0,
    ) -> Limits:
        """These limits, widened where a robot is beyond them: it may come back, and not go farther.

        Its ``command`` (1) and ``actual`` pose (1) are in the convention's frames, ``joints`` (1, 6) are
        those there, and ``wanted`` are margins (m,) as of :meth:`leg_margins`.
        """
        both = self.frames.inverse().poses(PoseBatch.joined([command, actual]))
        tilts, turns = both.tilts().tolist(), np.abs(both.turns()).tolist()
        margins = self.leg_margins(mechanism, geometry, actual, joints)[0]
        return replace(
            self,
            tilt=max(self.tilt, tilts[0]),
            turn=max(self.turn, turns[0]),
            joint_min=np.minimum(self.joint_min, joints[0]),
            joint_max=np.maximum(self.joint_max, joints[0]),
            axes=self.axes.including(both[:1]),
            stands_at=(tilts[1], turns[1]),
            legs=None if self.legs is None else self.legs.including(margins, wanted),
        )


def _are_within(poses: PoseBatch, tilt: float, turn: float) -> Mask:
    """Which of n poses in the controller's frames keep a tilt and a turn, rad."""
    kept: Mask = np.asarray(poses.tilts() <= tilt + ROUNDING)
    if turn < np.pi:
        kept = kept & (np.abs(poses.turns()) <= turn + ROUNDING)
    return kept
