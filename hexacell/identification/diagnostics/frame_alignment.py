"""Base and platform frames: fitted before pose errors are compared, and chosen for a new geometry.

Pose errors are compared after both frames are fitted (:class:`FrameFit`), as these are set by teaching. To
first order a base frame shifted by t and rotated by f, and a platform frame rotated by p about the ball,
change a pose (P, R) by

    dP = t + f x P,    dr = f + R p,

with dr the rotation vector in the base frame. The best (t, f, p) minimize the sum of squares over poses
that span the workspace, with rotations weighted by a length, the platform's radius; f is restricted to the
axes about which a work frame can be taught.

At the joint variables of a taught pose X a new geometry has another pose Y, in frames of its own. Its
chosen frames c (:func:`choose_frames`) have the smallest sum over taught poses of ``|dP|^2 + (r |dw|)^2``,
(dP, dw) the errors of c(Y) against X (``docs/method.md``, Frames of the written geometry). Gauss-Newton
finds them with the derivatives at X, which give the exact gradient: a small turn f moves c(Y) by f x c(Y)
= f x X + f x dP, whose last term is normal to dP, and a small turn w changes the length of dw by ``w . dw /
|dw|``, however large dw is.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.kinematics import rotations
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, FrameFreedom, Mechanism
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array

ALIGNMENT_ITERATIONS, CHOICE_ITERATIONS = 20, 50
ALIGNMENT_TOLERANCE, CHOICE_TOLERANCE = 1e-12, 1e-13
"""Convergence: largest turn, rad, and largest shift divided by the length."""

UNDETERMINED = 0.01
"""Changes that move the taught poses by less than this share of what others do are not made."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Position errors (n,), mm, and orientation errors (n,), rad, of n poses."""

    distances_mm: Array
    angles: Array

    @classmethod
    def of_squares(cls, squares: Array) -> "PoseErrors":
        """The errors by squares of components (n, 6): positions, mm^2, then rotation vectors, rad^2."""
        return cls(np.sqrt(squares[:, :3].sum(axis=-1)), np.sqrt(squares[:, 3:].sum(axis=-1)))

    def times(self, factor: float) -> "PoseErrors":
        """All errors multiplied by a factor."""
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


def pose_errors(reached: PoseBatch, commanded: PoseBatch) -> Array:
    """Errors (n, 6): positions, mm, then rotation vectors in the base frame, rad."""
    relative = reached.rotations @ np.swapaxes(commanded.rotations, -1, -2)
    return np.concatenate([reached.positions - commanded.positions, rotations.to_vector(relative)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class FrameFit:
    """The best frames over n poses, rotations weighted by ``length``, mm.

    ``turns`` are the axes (k, 3) about which the base frame may be turned.
    """

    workspace: PoseBatch
    length: float
    turns: Array = field(default_factory=lambda: np.eye(3))

    def coefficients(self, errors: Array) -> Array:
        """The best (t, f, p) (9, ...), mm and rad, for errors (n, 6, ...)."""
        scale = np.repeat([1.0, self.length], 3)
        # From shifts, turns about the free axes and of the platform to (t, f, p).
        free = np.zeros((9, 6 + len(self.turns)))
        free[:3, :3] = free[6:, -3:] = np.eye(3)
        free[3:6, 3:-3] = self.turns.T
        design = (frame_derivatives(self.workspace) * scale[:, None]).reshape(-1, 9) @ free
        values = (errors.reshape(len(errors), 6, -1) * scale[:, None]).reshape(len(design), -1)
        # Equal poses do not determine the frames; lstsq then gives the smallest change.
        best: Array = free @ np.linalg.lstsq(design, values)[0]
        return best.reshape(9, *errors.shape[2:])

    def remove_frame_motion(self, poses: PoseBatch, errors: Array, workspace_errors: Array) -> Array:
        """Errors (k, 6, ...) of other poses minus what the best frames explain, to first order."""
        best = self.coefficients(workspace_errors)
        return np.asarray(errors - np.tensordot(frame_derivatives(poses), best, axes=1))

    def aligned(self, reached: PoseBatch, others: PoseBatch) -> PoseBatch:
        """Poses ``others`` in the frames that fit ``reached`` to the workspace best (Gauss-Newton)."""
        for _ in range(ALIGNMENT_ITERATIONS):
            best = self.coefficients(pose_errors(reached, self.workspace))
            shift, base, platform = best.reshape(3, 3)
            change = FrameTransform(rotations.from_vector(-base), shift, rotations.from_vector(platform))
            reached, others = change.poses(reached), change.poses(others)
            if max(np.abs(best[:3]).max() / self.length, np.abs(best[3:]).max()) < ALIGNMENT_TOLERANCE:
                break
        return others


def frame_derivatives(poses: PoseBatch) -> Array:
    """Derivatives (n, 6, 9) of pose errors by t, f and p."""
    design = np.zeros((len(poses), 6, 9))
    design[:, :3, :3] = np.eye(3)
    design[:, :3, 3:6] = -rotations.skew(poses.positions)
    design[:, 3:, 3:6] = np.eye(3)
    design[:, 3:, 6:] = poses.rotations
    return design


def choose_frames(
    mechanism: Mechanism, branch: Branch, *, taught: Geometry, new: Geometry, poses: PoseBatch
) -> tuple[Geometry, PoseErrors]:
    """The ``new`` geometry, in the frame convention, in the frames in which n taught poses move least.

    And how far those that both geometries reach move nevertheless, at equal joint variables. The poses are
    in the frames of the geometry with which they were ``taught``. If both geometries reach no pose, these
    frames are kept, as the mechanism's convention has them.
    """
    normalized, convention = mechanism.normalize_frames(taught)
    robot = CommandedRobot(mechanism, branch, commanding=normalized, actual=new)
    reached = robot.actual_poses(convention.poses(poses))
    targets, reached_poses = poses[reached.found], reached.poses[reached.found]
    length = float(mechanism.platform_radius(new))
    frames = convention.inverse()
    if len(targets):
        freedom = replace(mechanism.frame_freedom, base="")  # gauges measure along the axes of the base
        frames = frames.then(closest_frames(freedom, length, frames.poses(reached_poses), targets))
    displacement = PoseErrors.of_squares(pose_errors(frames.poses(reached_poses), targets) ** 2)
    return mechanism.change_frames(new, frames), displacement


def closest_frames(
    freedom: FrameFreedom, length: float, reached: PoseBatch, targets: PoseBatch
) -> FrameTransform:
    """The change of frames that brings n poses closest to n others; rotations count by ``length``, mm."""
    pivot = np.where([axis in freedom.shift for axis in "xyz"], targets.positions.mean(axis=0), 0.0)
    # Turns are about the pivot and times the length: where the poses leave a choice, the smallest change is
    # then a small one everywhere among them.
    design = frame_derivatives(PoseBatch(targets.positions - pivot, targets.rotations))
    design[:, 3:] *= length
    design[:, :, 3:] /= length
    solution = np.linalg.pinv(design.reshape(-1, 9)[:, freedom.columns], rcond=UNDETERMINED)
    weights = np.repeat([1.0, length], 3)
    frames = FrameTransform(np.eye(3), np.zeros(3), np.eye(3))
    for _ in range(CHOICE_ITERATIONS):
        errors = pose_errors(frames.poses(reached), targets) * weights
        step = np.zeros(9)
        step[freedom.columns] = solution @ errors.ravel()
        shift, base, platform = step.reshape(3, 3) / np.array([[1.0], [length], [length]])
        turn = rotations.from_vector(-base)
        moved = pivot + turn.T @ (shift - pivot)
        frames = frames.then(FrameTransform(turn, moved, rotations.from_vector(platform)))
        if np.abs(step).max() < CHOICE_TOLERANCE * length:
            break
    return frames
