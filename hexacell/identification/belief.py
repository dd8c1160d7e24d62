"""What is known of the robot at one moment, and the limits it must keep."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hexacell.identification.gauge_travel import GaugeRoom, GaugeTravel
from hexacell.identification.problem.problem import Noise
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, FrameTransform, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.refused_commands import RefusedCommands
from hexacell.kinematics.rotations import Array, Mask

SAME_FRAMES = FrameTransform(np.eye(3), np.zeros(3), np.eye(3))


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that every commanded pose keeps: mm and rad; the singularity margin is dimensionless.

    Attributes:
        frames: from the frames of the commands, in which a level platform is level, to the convention's.
        gauges: travels and plungers; without them the ball may go as far to all sides.
        zeroed: the room of the gauges as they were zeroed; none where that is not known yet.
    """

    gauge_travel_mm: float
    tilt: float
    joint_min_mm: float
    joint_max_mm: float
    singularity_margin: float
    frames: FrameTransform = field(default=SAME_FRAMES, compare=False)
    gauges: GaugeTravel | None = None
    zeroed: GaugeRoom | None = None

    @property
    def room(self) -> GaugeRoom:
        """How far the ball may go from the gauges' zero."""
        if self.zeroed is not None:
            return self.zeroed
        return GaugeRoom.symmetric(self.gauge_travel_mm) if self.gauges is None else self.gauges.room()

    @property
    def sure_room(self) -> GaugeRoom:
        """The same of any station that is mounted well enough."""
        return self.room if self.gauges is None else self.gauges.sure_room

    def within_travel(
        self, deviations: Array, spread: Array | float = 0.0, share: float = 1.0, *, surely: bool = False
    ) -> Mask:
        """Which deviations (..., 3), mm, in the convention's frames stay within a share of the room.

        With ``surely`` it is that of any station.
        """
        room = self.sure_room if surely else self.room
        return room.holds(deviations @ self.frames.base, spread, share)

    def zeroed_at(self, shown_mm: tuple[float, float, float] | None) -> Limits:
        """The same once the gauges were zeroed where they show ``shown_mm`` along base x, y, z."""
        if self.gauges is None or shown_mm is None:
            return self
        return replace(self, zeroed=self.gauges.room(shown_mm))

    def tilts(self, poses: PoseBatch) -> Array:
        """The tilts (n,), rad, of poses in the convention's frames."""
        return self.frames.inverse().poses(poses).tilts()

    def orientations(self, turns: Array) -> Array:
        """Turns (n, 3, 3) of a level platform, as orientations in the convention's frames."""
        turned: Array = self.frames.base @ turns @ self.frames.platform.T
        return turned


@dataclass(frozen=True, eq=False)
class RobotBelief:
    """The estimate and its covariance beside the geometry that the controller commands with.

    All geometries are in the mechanism's frame convention.

    Attributes:
        free: estimated free parameters (p,), mm.
        covariance: theirs (p, p), mm^2.
        work_frame_turns: axes (k, 3) about which a work frame can be taught.
        refused: commands that the controller refused.
    """

    mechanism: Mechanism
    controller: Geometry
    branch: Branch
    free: Array
    covariance: Array
    noise: Noise
    limits: Limits
    work_frame_turns: Array = field(default_factory=lambda: np.eye(3))
    refused: RefusedCommands = field(default_factory=RefusedCommands)

    def zeroed_at(self, shown_mm: tuple[float, float, float] | None) -> RobotBelief:
        """The same at gauges that were zeroed where they show ``shown_mm`` along base x, y, z."""
        return self if shown_mm is None else replace(self, limits=self.limits.zeroed_at(shown_mm))

    @property
    def basis(self) -> Array:
        """(P, p), from free parameters to all of them."""
        return self.mechanism.convention.basis()

    @cached_property
    def estimate(self) -> Geometry:
        """The estimated geometry."""
        return self.mechanism.convention.geometry(self.free)

    @cached_property
    def commanded(self) -> CommandedRobot:
        """The estimated robot under its controller."""
        geometries, refused = (self.controller, self.estimate), (self.refused, self.limits.frames)
        return CommandedRobot(self.mechanism, self.branch, *geometries, *refused)
