"""Predicted pose accuracy: the error of commanded poses before and after calibration.

Before: the controller has its present geometry and the machine the estimate; their difference is computed
by continuation, and what is not geometry and not corrected is added. After: the controller has the
estimate, from which the machine differs by a random error of the covariance C. To first order the pose
error is ``H dx`` with H the implicit derivative of the pose by the parameters, so its covariance is
``H C H^T``. In both, base and platform frames are fitted over the workspace, so that teaching cannot remove
what is left. The repeatability of the machine is not included.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.frame_alignment import FrameFit, PoseErrors, pose_errors
from hexacell.identification.placement import Placement
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import free_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """Predicted errors at the task poses.

    Attributes:
        poses: the reachable task poses, in the mechanism's frame convention.
        reachable: (k,) bool, which of all task poses these are.
        before: with the controller's present geometry, the systematic error.
        after: with the identified geometry: one standard deviation (root mean square) of each error.
    """

    poses: PoseBatch
    reachable: Mask
    before: PoseErrors
    after: PoseErrors

    @property
    def removable_mm(self) -> float:
        """Root mean square distance that the identified geometry removes.

        The error before calibration contains the error of the estimate; its square is subtracted.
        """
        squares = self.before.position_rms_mm**2 - self.after.position_rms_mm**2
        return float(np.sqrt(max(squares, 0.0)))


def predicted_accuracy(belief: RobotBelief, *, task: PoseBatch, workspace: PoseBatch) -> Accuracy | None:
    """Predict the accuracy at task poses, with frames fitted over those of the workspace.

    All are in the mechanism's frame convention. None if none of the task or of the workspace is reachable.
    """
    reached, task_reachable = _reached(belief, task)
    reached_workspace, workspace_reachable = _reached(belief, workspace)
    if not task_reachable.any() or not workspace_reachable.any():
        return None
    task, workspace = task[task_reachable], workspace[workspace_reachable]
    frames = teachable_frames(belief, workspace)
    aligned = frames.aligned(reached_workspace[workspace_reachable], reached[task_reachable])
    before = pose_errors(aligned, task)
    if (terms := belief.terms) is not None:
        at_task, over = placement_of(belief, task), placement_of(belief, workspace)
        by_terms = errors_by_terms(terms.terms, frames, at_task, over)
        before = before + by_terms @ terms.left_by(belief.corrections)
    jacobian = error_jacobian(belief, task, workspace)
    # The trace of a covariance is the mean square length.
    return Accuracy(
        poses=task,
        reachable=task_reachable,
        before=PoseErrors.of_squares(before**2),
        after=PoseErrors.of_squares(np.einsum("nap,pq,naq->na", jacobian, belief.covariance, jacobian)),
    )


def error_jacobian(belief: RobotBelief, task: PoseBatch, workspace: PoseBatch) -> Array:
    """Derivatives (n, 6, p), mm and rad by mm, of the errors at n task poses by the free parameters.

    The estimated robot reaches all of them, and all of the workspace, over which the frames are fitted.
    """
    poses = PoseBatch.joined([task, workspace])
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
    both = free_sensitivity(belief.mechanism, belief.estimate, poses, joints).free
    of_task, of_workspace = both[: len(task)], both[len(task) :]
    return teachable_frames(belief, workspace).remove_frame_motion(task, of_task, of_workspace)


def errors_by_terms(
    terms: Sequence[ModelTerm], frames: FrameFit, task: Placement, workspace: Placement
) -> Array:
    """Errors (t, 6, 6 m) at task poses by one unit of each coefficient of m terms, with frames fitted.

    Those of a term that acts by the direction of arrival, which is another at each stop, are zero.
    """
    found = np.zeros((len(task), 6, len(terms), task.joints.shape[1]))
    for row, term in enumerate(terms):
        if not term.needs_directions:
            at_task, over = (term.pose_errors(at, np.zeros_like(at.joints)) for at in (task, workspace))
            found[:, :, row] = frames.remove_frame_motion(task.poses, at_task, over)
    return found.reshape(len(task), 6, -1)


def placement_of(belief: RobotBelief, poses: PoseBatch) -> Placement:
    """The estimated robot at poses that it reaches."""
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
    return Placement(belief.mechanism, belief.estimate, poses, joints)


def teachable_frames(belief: RobotBelief, workspace: PoseBatch) -> FrameFit:
    """The frames that are fitted over workspace poses: those that can be taught to the controller."""
    radius = float(belief.mechanism.platform_radius(belief.estimate))
    return FrameFit(workspace, radius, belief.work_frame_turns)


def _reached(belief: RobotBelief, commanded: PoseBatch) -> tuple[PoseBatch, Mask]:
    """Actual poses of the estimated robot at n commanded poses, and which are reachable.

    Reachable means: with the controller's present geometry, and with the estimate in the controller.
    """
    actual = belief.commanded.actual_poses(commanded)
    corrected = belief.mechanism.inverse(belief.estimate, belief.branch, commanded)
    return actual.poses, actual.found & np.isfinite(corrected).all(axis=-1)
