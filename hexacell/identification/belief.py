"""What is known of the robot at one moment, and the limits it must keep."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hexacell.identification.problem.problem import Noise
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, FrameTransform, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

SAME_FRAMES = FrameTransform(np.eye(3), np.zeros(3), np.eye(3))


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that every commanded pose keeps: mm and rad; the singularity margin is dimensionless.

    Attributes:
        frames: from the frames of the commands, in which a level platform is level, to the convention's.
    """

    gauge_travel_mm: float
    tilt: float
    joint_min_mm: float
    joint_max_mm: float
    singularity_margin: float
    frames: FrameTransform = field(default=SAME_FRAMES, compare=False)

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
    """

    mechanism: Mechanism
    controller: Geometry
    branch: Branch
    free: Array
    covariance: Array
    noise: Noise
    limits: Limits
    work_frame_turns: Array = field(default_factory=lambda: np.eye(3))

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
        return CommandedRobot(self.mechanism, self.branch, self.controller, self.estimate)
