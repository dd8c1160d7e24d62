"""What is known of the robot at one moment."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hexacell.identification.placement import Placement
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.kinematics.commanded_motion import ActualPoses, CommandedRobot, RefusedCommands
from hexacell.kinematics.corrections import NO_CORRECTIONS, Corrections
from hexacell.kinematics.forward import apply_twist
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import FreeSensitivity, free_sensitivity
from hexacell.limits.limits import Limits

SPARE_ANGLE = float(np.radians(0.5))
"""Turn of the platform, rad, by which the estimate may be wrong once many poses were measured."""

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
        covariance: of the free parameters (p, p), mm^2.
        work_frame_turns: axes (k, 3) about which a work frame can be taught.
        corrections: what the controller adds to its inverse kinematics for what is not geometry.
        terms: what was identified of that; None for nothing.
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
    corrections: Corrections = NO_CORRECTIONS
    terms: TermEstimates | None = None

    def beside(self, poses: PoseBatch, joints: Array) -> Array:
        """Where the ball is beside n poses of the estimate by what is not geometry (n, 3), mm.

        Without the terms that act by the direction of arrival.
        """
        moved, unknown = np.zeros((len(joints), 3)), np.zeros_like(joints)
        if self.terms is None:
            return moved
        at = Placement(self.mechanism, self.estimate, poses, joints)
        for term in self.terms.terms:
            moved = moved + term.pose_errors(at, unknown)[:, :3] @ self.terms.of(term.name)[0]
        return moved

    def zeroed_at(self, shown_mm: tuple[float, float, float] | None) -> "RobotBelief":
        """This belief with gauges that were zeroed where they show ``shown_mm`` along base x, y, z."""
        return self if shown_mm is None else replace(self, limits=self.limits.zeroed_at(shown_mm))

    @cached_property
    def joint_covariance(self) -> Array:
        """Covariance (p + 6 m, p + 6 m) of the free parameters and of the coefficients of m terms."""
        return self.covariance if self.terms is None else self.terms.joint_covariance(self.covariance)

    def knowing(self, joint_covariance: Array) -> "RobotBelief":
        """This estimate with another covariance of parameters and coefficients."""
        free = len(self.free)
        own, crossed = joint_covariance[:free, :free], joint_covariance[free:, :free]
        known = replace(self, covariance=own)
        if self.terms is None:
            return known
        of_terms = joint_covariance[free:, free:]
        return replace(known, terms=replace(self.terms, covariance=of_terms, with_parameters=crossed))

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
        at_first = free_sensitivity(self.mechanism, self.estimate, poses[:1], joints[:1])
        return float(self.orientation_sigmas(at_first)[0])

    def orientation_sigmas(self, sensitivity: FreeSensitivity) -> Array:
        """Standard deviations (n,), rad, of the platform's orientation, from the ``sensitivity`` there."""
        rotation = sensitivity.free[:, 3:]
        return np.asarray(np.sqrt(((rotation @ self.covariance) * rotation).sum(axis=-1).max(axis=-1)))

    @cached_property
    def least_margins(self) -> Array:
        """Margins (m,) that passive joints and legs keep for ``SPARE_ANGLE``, or () without limits."""
        return self.margins_for(SPARE_ANGLE)

    def margins_for(self, turn: float) -> Array:
        """Margins (m,) to keep should the platform be turned by an angle, rad, from the estimate."""
        if self.limits.legs is None:
            return np.zeros(())
        return self.limits.legs.margins_for(turn, float(self.mechanism.platform_radius(self.estimate)))

    def margins_at(self, at: ActualPoses) -> Array:
        """Margins (n, m) to keep where the robot goes without a record, from each of n poses.

        They are ``SPARE_SIGMAS`` of what is not known there. While the orientation is uncertain nothing of
        use would be left; the robot then goes only where robots drawn within the tolerances were tried.
        """
        if self.limits.legs is None:
            return np.zeros((len(at.joints), 0))
        sensitivity = free_sensitivity(self.mechanism, self.estimate, at.poses, at.joints)
        margins = np.tile(self.least_margins, (len(at.joints), 1))
        known = np.flatnonzero(self.orientation_sigmas(sensitivity) <= UNCERTAIN_SIGMA)
        if len(known):
            there = at[known]
            margins[known] += SPARE_SIGMAS * self.margin_sigmas(
                there.poses, there.joints, sensitivity[known]
            )
        return margins

    def margin_sigmas(self, poses: PoseBatch, joints: Array, sensitivity: FreeSensitivity) -> Array:
        """Standard deviations (n, m) of the margins of passive joints and legs at n poses.

        By linear propagation, from the ``sensitivity`` there.
        """
        variances, axes = np.linalg.eigh(self.covariance)
        one_sigma = np.sqrt(np.maximum(variances, 0.0))[:, None] * axes.T  # along each principal axis
        changes = np.vstack([np.zeros(len(self.free)), one_sigma])
        count, every = len(joints), len(changes)
        rows = np.arange(count).repeat(every)
        vectors = self.estimate.vector + changes @ self.mechanism.convention.basis.T
        robots = GeometryBatch(self.mechanism.parameters, np.tile(vectors, (count, 1)))
        steps = changes @ np.swapaxes(sensitivity.free, -1, -2)
        moved = apply_twist(poses[rows], steps.reshape(-1, 6))
        margins = self.limits.leg_margins(self.mechanism, robots, moved, joints[rows])
        margins = margins.reshape(count, every, margins.shape[-1])
        return np.asarray(np.linalg.norm(margins[:, 1:] - margins[:, :1], axis=1))

    def keeps_limits(self, poses: PoseBatch, joints: Array, wanted: Array | None = None) -> Mask:
        """Whether the estimated robot keeps its limits at n poses with joint variables (n, 6), mm.

        The limits are those of tilt and turn, joint ranges, passive joints and legs, with the ``wanted``
        margins (m,) or the least ones; an unreachable pose (NaN) does not keep them.
        """
        wanted = self.least_margins if wanted is None else wanted
        # Legs allow fewest; what else there is, is asked of the poses that are left.
        kept = self.limits.allow_legs(self.mechanism, self.estimate, poses, joints, wanted)
        kept[kept] = self.limits.allow_poses(poses[kept], joints[kept])
        return kept

    def standing_at(self, command: PoseBatch, actual: ActualPoses, wanted: Array) -> "RobotBelief":
        """This belief with its limits widened where the robot is beyond them at a command (1)."""
        at = command, actual.poses, actual.joints, wanted
        return replace(self, limits=self.limits.including(self.mechanism, self.estimate, *at))
