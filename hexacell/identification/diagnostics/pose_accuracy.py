"""Predicted pose accuracy: the error of commanded poses before and after calibration.

A controller with geometry c computes the joint variables of a commanded pose X under c. The machine
with geometry m takes the pose that these joint variables give under m.

Before: c is the controller's present geometry and m the estimate. The difference is computed without
approximation, by continuation. After: c is the estimate and m the true geometry, which differs from it
by a random error with the covariance C of the estimate. To first order the pose error is ``H dx`` with
H the implicit derivative of the pose by the parameters, so its covariance is ``H C H^T``.

In both, base and platform frames are fitted over the workspace
(:mod:`~hexacell.identification.diagnostics.frame_alignment`), so the remaining errors cannot be removed
by teaching. The repeatability of the machine is not included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Distances (n,), mm, and angles (n,), rad, of n poses from where they should be."""

    distances_mm: Array
    angles: Array

    def times(self, factor: float) -> PoseErrors:
        """All of them by a factor."""
        return PoseErrors(factor * self.distances_mm, factor * self.angles)

    @property
    def position_rms_mm(self) -> float:
        """Root mean square distance."""
        return float(np.sqrt(np.mean(self.distances_mm**2)))

    @property
    def position_largest_mm(self) -> float:
        """Largest distance."""
        return float(self.distances_mm.max())

    @property
    def orientation_rms_deg(self) -> float:
        """Root mean square angle."""
        return float(np.degrees(np.sqrt(np.mean(self.angles**2))))

    @property
    def orientation_largest_deg(self) -> float:
        """Largest angle."""
        return float(np.degrees(self.angles.max()))


@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """Predicted errors at the task poses.

    Attributes:
        poses: the task poses that the robot can take, in the mechanism's frame convention.
        reachable: (k,) bool, which of those asked for they are.
        before: with the controller's present geometry: the systematic error.
        after: with the identified one: one standard deviation (root mean square) of each.
    """

    poses: PoseBatch
    reachable: Mask
    before: PoseErrors
    after: PoseErrors

    @property
    def removable_mm(self) -> float:
        """Root mean square distance that the identified geometry removes.

        The difference from the controller's geometry contains the error of the estimate, too.
        """
        squares = self.before.position_rms_mm**2 - self.after.position_rms_mm**2
        return float(np.sqrt(max(squares, 0.0)))


def predicted_accuracy(
    found: Identification, controller: Geometry, branch: Branch, *, task: PoseBatch, workspace: PoseBatch
) -> Accuracy | None:
    """The accuracy at task poses; none if the robot can take no task pose or no workspace pose.

    Args:
        found: the estimate and its covariance.
        controller: what the controller has now, in the mechanism's frame convention.
        branch: of the inverse kinematics.
        task: where the accuracy is asked for.
        workspace: poses over which the frames are chosen.
    """
    reached, can_take = _reached(found, controller, branch, task)
    reached_workspace, can_span = _reached(found, controller, branch, workspace)
    if not can_take.any() or not can_span.any():
        return None
    task, workspace = task[can_take], workspace[can_span]
    fit = FrameFit(workspace, float(found.problem.mechanism.platform_radius(found.geometry)))
    aligned = fit.aligned(reached_workspace[can_span], reached[can_take])
    jacobian = fit.remove_frame_motion(
        task, _derivatives(found, branch, task), _derivatives(found, branch, workspace)
    )
    # The trace of a covariance is the mean square length.
    mean_squares = np.einsum("nap,pq,naq->na", jacobian, found.free_covariance, jacobian)
    return Accuracy(
        poses=task,
        reachable=can_take,
        before=_lengths(pose_errors(aligned, task) ** 2),
        after=_lengths(mean_squares),
    )


def _reached(
    found: Identification, controller: Geometry, branch: Branch, commanded: PoseBatch
) -> tuple[PoseBatch, Mask]:
    """Where the estimated robot goes when the controller is sent to n poses, and which poses it can take.

    A pose that the estimate itself could not be commanded to, once the controller has it, is left out.
    """
    mechanism = found.problem.mechanism
    actual = CommandedRobot(mechanism, branch, controller, found.geometry).actual_poses(commanded)
    corrected = mechanism.inverse(found.geometry, branch, commanded)
    return actual.poses, actual.found & np.isfinite(corrected).all(axis=-1)


def _derivatives(found: Identification, branch: Branch, poses: PoseBatch) -> Array:
    """Of the poses (n, 6, p) by the free parameters, the joint variables being those of the estimate."""
    mechanism = found.problem.mechanism
    joints = mechanism.inverse(found.geometry, branch, poses)
    sensitivity = pose_sensitivity(mechanism, found.geometry, poses, joints)
    return sensitivity.parameters @ found.problem.basis


def _lengths(squares: Array) -> PoseErrors:
    """Of squared components (n, 6): positions, mm^2, then rotation vectors, rad^2."""
    return PoseErrors(np.sqrt(squares[:, :3].sum(axis=-1)), np.sqrt(squares[:, 3:].sum(axis=-1)))
