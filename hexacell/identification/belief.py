"""What is known of the robot at one moment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hexacell.identification.problem.problem import Noise
from hexacell.kinematics.commanded_motion import ActualPoses, CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.limits import Limits
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.refused_commands import RefusedCommands
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import Sensitivity, pose_sensitivity

SPARE_ANGLE = float(np.radians(0.5))
"""Of passive joints, rad: what the estimate may be wrong by once many poses were measured."""

SPARE_SIGMAS = 4.0
"""Standard deviations of the platform's orientation that passive joints keep besides."""

UNCERTAIN_SIGMA = float(np.radians(3.0))
"""Standard deviation, rad, beyond which the orientation is uncertain. Under the drawing's tolerances one
robot in a hundred then deviates twenty times as far as linear propagation gives."""


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

    def orientation_sigma(self, poses: PoseBatch, joints: Array) -> float:
        """Standard deviation, rad, of the platform's orientation at the first of n poses.

        About the base axis about which it is known least.
        """
        at_first = poses[:1], joints[:1]
        return self.orientation_sigma_from(pose_sensitivity(self.mechanism, self.estimate, *at_first))

    def orientation_sigma_from(self, sensitivity: Sensitivity) -> float:
        """The same from the sensitivity there."""
        rotation = sensitivity.parameters[0, 3:] @ self.basis
        return float(np.sqrt(np.einsum("ip,pq,iq->i", rotation, self.covariance, rotation).max()))

    def spare_angle(self, at: ActualPoses) -> float:
        """What passive joints are to have left, rad, on a way from the first of some poses.

        While the orientation is uncertain nothing of use would be left; the robot then goes only where
        robots drawn within the tolerances were tried.
        """
        sigma = self.orientation_sigma(at.poses, at.joints)
        return SPARE_ANGLE if sigma > UNCERTAIN_SIGMA else SPARE_ANGLE + SPARE_SIGMAS * sigma

    def keeps_limits(self, poses: PoseBatch, joints: Array, spare: float = SPARE_ANGLE) -> Mask:
        """At which of n poses, with joint variables (n, 6), mm, the estimated robot keeps its limits.

        Those of tilt and turn, joint ranges, passive joints (with ``spare`` left, rad) and legs; an
        unreachable pose (NaN) does not.
        """
        kept = self.limits.allow_poses(poses, joints)
        of_estimate = (self.mechanism, self.estimate, poses[kept], joints[kept])
        kept[kept] = self.limits.allow_legs(*of_estimate, spare)
        return kept

    def standing_at(
        self, command: PoseBatch, actual: ActualPoses, spare: float = SPARE_ANGLE
    ) -> RobotBelief:
        """The same, its limits widened where the robot is beyond them at a command (1)."""
        at = (command, actual.poses, actual.joints)
        limits = self.limits.including(self.mechanism, self.estimate, *at, spare)
        return replace(self, limits=limits)
