"""The frames of a new geometry in which taught poses move least at equal joint variables.

An identification leaves the frames of a geometry open: the mechanism's parameters can express it in any
of them (:class:`~hexacell.kinematics.mechanism.FrameFreedom`). The base frame is not turned all the same:
the gauges measure along its axes, and stay where they are when a new geometry is written. Points, work
frames and tool frames were taught with an earlier geometry. At the joint variables q of a taught pose X the
new geometry has another pose Y, in frames of its own. The chosen change of frames c is the one with the
smallest

    sum over taught poses of |dP|^2 + (r |dw|)^2,    (dP, dw) = pose errors of c(Y) against X,

with r a length, the platform's radius. It is found by Gauss-Newton with the derivatives at X. They give the
exact gradient of the sum: a small turn f moves c(Y) by f x c(Y) = f x X + f x dP, whose last term is normal
to dP, and a small turn w changes the length of dw by ``w . dw / |dw|``, however large dw is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.diagnostics.frame_alignment import frame_derivatives, pose_errors
from hexacell.identification.diagnostics.pose_accuracy import PoseErrors
from hexacell.kinematics import rotations
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, FrameFreedom, FrameTransform, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

MAX_ITERATIONS = 50
TOLERANCE = 1e-13
"""Convergence: largest turn, rad, and largest shift divided by the length."""

UNDETERMINED = 0.01
"""Changes that move the taught poses by less than this share of what others do are not made.

Poses in one place do not tell a turn of the base frame from one of the platform frame, for example."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameChoice:
    """The frames of a new geometry, and how far the taught poses move nevertheless.

    Attributes:
        geometry: the new geometry in the chosen frames.
        frames: from the mechanism's convention to the chosen frames.
        found: (n,) which of the taught poses both geometries reach; the others did not count.
        displacement: of the poses found, at equal joint variables: mm and rad.
    """

    geometry: Geometry
    frames: FrameTransform
    found: Mask
    displacement: PoseErrors


def choose_frames(
    mechanism: Mechanism, branch: Branch, *, taught: Geometry, new: Geometry, poses: PoseBatch
) -> FrameChoice:
    """The frames in which the ``new`` geometry moves n taught poses least.

    Args:
        mechanism: of both geometries.
        branch: of both.
        taught: the geometry of the time of teaching, in the frames of that time.
        new: the new geometry, in the mechanism's frame convention.
        poses: in the frames of ``taught``. If both geometries reach none of them, the frames of ``taught``
            are kept, as the mechanism's convention has them.
    """
    normalized, convention = mechanism.normalize_frames(taught)
    robot = CommandedRobot(mechanism, branch, commanding=normalized, actual=new)
    reached = robot.actual_poses(convention.poses(poses))
    targets, reached_poses = poses[reached.found], reached.poses[reached.found]
    length = float(mechanism.platform_radius(new))
    frames = convention.inverse()
    if len(targets):
        freedom = replace(mechanism.frame_freedom, base="")  # gauges measure along the axes of the base
        change = closest_frames(freedom, length, frames.poses(reached_poses), targets)
        frames = frames.then(change)
    return FrameChoice(
        mechanism.change_frames(new, frames),
        frames,
        reached.found,
        _sizes(pose_errors(frames.poses(reached_poses), targets)),
    )


def closest_frames(
    freedom: FrameFreedom, length: float, reached: PoseBatch, targets: PoseBatch
) -> FrameTransform:
    """The change of frames that brings n poses closest to n others; rotations count by ``length``, mm."""
    pivot = np.where([axis in freedom.shift for axis in "xyz"], targets.positions.mean(axis=0), 0.0)
    solution = _pseudoinverse(freedom, length, targets, pivot)
    weights = np.repeat([1.0, length], 3)
    frames = FrameTransform(np.eye(3), np.zeros(3), np.eye(3))
    for _ in range(MAX_ITERATIONS):
        errors = pose_errors(frames.poses(reached), targets) * weights
        step = np.zeros(9)
        step[freedom.columns] = solution @ errors.ravel()
        frames = frames.then(_change(step, length, pivot))
        if np.abs(step).max() < TOLERANCE * length:
            break
    return frames


def _pseudoinverse(freedom: FrameFreedom, length: float, targets: PoseBatch, pivot: Array) -> Array:
    """The best free changes (k, 6n), all in mm, for weighted errors.

    Turns are about the pivot and times the length: where the poses leave a choice, the smallest change
    is then a small one everywhere among them.
    """
    centred = PoseBatch(targets.positions - pivot, targets.rotations)
    design = frame_derivatives(centred)
    design[:, 3:] *= length
    design[:, :, 3:] /= length
    inverse: Array = np.linalg.pinv(design.reshape(-1, 9)[:, freedom.columns], rcond=UNDETERMINED)
    return inverse


def _change(step: Array, length: float, pivot: Array) -> FrameTransform:
    """The change of frames that removes a shift, a turn of the base and one of the platform (9,), mm."""
    shift, base, platform = step.reshape(3, 3) / np.array([[1.0], [length], [length]])
    turn = rotations.from_vector(-base)
    return FrameTransform(turn, pivot + turn.T @ (shift - pivot), rotations.from_vector(platform))


def _sizes(errors: Array) -> PoseErrors:
    return PoseErrors(np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1))
