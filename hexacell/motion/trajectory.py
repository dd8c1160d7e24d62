"""Straight lines of commands, and the actual path of a robot under its controller.

The controller interpolates the command linearly. The actual pose at each point of the line closes the
robot's own geometry at the joint variables that the controller computes; it is found by path tracking
with a predictor and a corrector (Allgower & Georg, Numerical Continuation Methods, 1990). The predictor
moves the last actual pose by the change of the command, the corrector is Newton's method.

Tracking point by point is slow for many lines, so :func:`trace_path` first corrects all points of all
lines at once, each predicted from the start of its line. That is exact wherever Newton's method stays on
the branch. Lines that may have left it are verified, and tracked point by point if that fails.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hexacell.kinematics import rotations
from hexacell.kinematics.forward import forward_kinematics, modes_of
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import SAME_FRAMES, FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array, Mask

PIECES = 12
PIECES_BETWEEN_WAYPOINTS = 4
"""Pieces that a line is divided into."""

TOLERANCE_MM = 1e-4
"""Largest constraint at the poses of a line; gauge travel is checked in tenths of a millimetre."""

JUMP_MM = 20.0
JUMP_ANGLE = np.radians(10.0)
"""Largest difference, within a piece of a line, between the motion of the robot and of the command.
A larger one may be a jump to another solution."""


def interpolate_line(
    start: PoseBatch, end: PoseBatch, pieces: int = PIECES, frames: FrameTransform = SAME_FRAMES
) -> PoseBatch:
    """The poses on a controller's straight lines, ``pieces + 1`` a line.

    Controllers interpolate all six numbers x, y, z, a, b, c linearly, angles included (LinuxCNC's G0).
    ``end`` has n poses and ``start`` one or n. The poses of n lines are ordered by piece, then by line.
    ``frames`` lead from the controller's, in whose angles it interpolates, to those of the poses.
    """
    if not all(np.array_equal(turn, np.eye(3)) for turn in (frames.base, frames.platform)):
        start, end = (frames.inverse().poses(poses) for poses in (start, end))
        return frames.poses(interpolate_line(start, end, pieces))
    fraction = np.linspace(0.0, 1.0, pieces + 1)[:, None, None]
    start_angles, end_angles = (rotations.to_angles(poses.rotations) for poses in (start, end))
    positions = (1.0 - fraction) * start.positions + fraction * end.positions
    angles = (1.0 - fraction) * start_angles + fraction * end_angles
    return PoseBatch(positions.reshape(-1, 3), rotations.from_angles(angles.reshape(-1, 3)))


def interpolate_lines(
    waypoints: Sequence[PoseBatch], refinement: int = 1, frames: FrameTransform = SAME_FRAMES
) -> PoseBatch:
    """The poses (pieces + 1, n) on straight lines from waypoint to waypoint, as ``interpolate_line``.

    Waypoints have one or n poses each, n at the end. ``refinement`` multiplies the usual number of pieces.
    """
    pieces = refinement * (PIECES if len(waypoints) == 2 else PIECES_BETWEEN_WAYPOINTS)
    parts = [
        interpolate_line(start, end, pieces, frames).in_shape(-1, len(waypoints[-1]))
        for start, end in pairwise(waypoints)
    ]
    return PoseBatch.joined([parts[0][:1], *(part[1:] for part in parts)])


def trace_path(
    mechanism: Mechanism,
    geometry: Geometry,
    commands: PoseBatch,
    joints: Array,
    start: PoseBatch,
    *,
    thorough: bool = True,
) -> tuple[PoseBatch, Mask]:
    """The actual path of a robot whose joints move through (pieces + 1, n, 6), mm, along n lines.

    ``start`` (1) is the actual pose at the start of all lines. Lines on which poses from one parallel
    correction cannot be confirmed, a few in a hundred, are tracked point by point if ``thorough``, else
    they count as not found.

    Returns:
        The poses (pieces + 1, n), and the lines (n,) along which the robot stays on its assembly mode;
        on the others the poses are undefined.
    """
    robot = _Robot(mechanism, geometry, modes_of(mechanism, geometry, start, joints[0, :1]))
    actual, converged = robot.correct(joints, _predict(commands[:1], commands, start.in_shape(1, 1)))
    confirmed: Mask = np.all(converged, axis=0)
    suspect = np.flatnonzero(confirmed & _may_have_jumped(commands, actual))
    if len(suspect):
        confirmed[suspect] = robot.confirm(joints[:, suspect], commands[:, suspect], actual[:, suspect])
    open_rows = np.flatnonzero(~confirmed)
    if not (thorough and len(open_rows)):
        return actual, confirmed
    tracked, confirmed[open_rows] = _track(robot, commands[:, open_rows], joints[:, open_rows], start)
    return actual.with_rows(np.s_[:, open_rows], tracked), confirmed


@dataclass(frozen=True, slots=True, eq=False)
class _Robot:
    """A robot on one assembly mode: the sign ``mode`` (1,) of its Jacobian's determinant."""

    mechanism: Mechanism
    geometry: Geometry
    mode: Array

    def correct(self, joints: Array, predicted: PoseBatch) -> tuple[PoseBatch, Mask]:
        """Newton's method from predicted poses at joints (m, n, 6), mm; which converged (m, n)."""
        shape = joints.shape[:2]
        result = forward_kinematics(
            self.mechanism,
            self.geometry,
            joints.reshape(-1, joints.shape[-1]),
            predicted.in_shape(-1),
            mode=self.mode.repeat(shape[0] * shape[1]),
            tolerance_mm=TOLERANCE_MM,
        )
        return result.poses.in_shape(*shape), result.found.reshape(shape)

    def confirm(self, joints: Array, commands: PoseBatch, actual: PoseBatch) -> Mask:
        """On which lines (n,) each pose is found again from the pose before it."""
        again, converged = self.correct(joints[1:], _predict(commands[:-1], commands[1:], actual[:-1]))
        same = np.abs(again.positions - actual.positions[1:]).max(axis=-1) < 10.0 * TOLERANCE_MM
        confirmed: Mask = np.all(converged & same, axis=0)
        return confirmed


def _may_have_jumped(commands: PoseBatch, actual: PoseBatch) -> Mask:
    """On which lines (n,) the actual motion within a piece is far from the commanded one.

    It may be a jump to another solution of the forward kinematics; these are farther apart.
    """
    predicted = _predict(commands[:-1], commands[1:], actual[:-1])
    distance = np.linalg.norm(actual.positions[1:] - predicted.positions, axis=-1)
    cosine = 0.5 * (np.einsum("mnij,mnij->mn", actual.rotations[1:], predicted.rotations) - 1.0)
    suspect: Mask = ((distance > JUMP_MM) | (cosine < np.cos(JUMP_ANGLE))).any(axis=0)
    return suspect


def _predict(before: PoseBatch, after: PoseBatch, actual: PoseBatch) -> PoseBatch:
    """Actual poses moved by the change of the command from ``before`` to ``after``."""
    turns = after.rotations @ np.swapaxes(before.rotations, -1, -2)
    return PoseBatch(actual.positions + after.positions - before.positions, turns @ actual.rotations)


def _track(robot: _Robot, commands: PoseBatch, joints: Array, start: PoseBatch) -> tuple[PoseBatch, Mask]:
    """The path point by point, each point predicted from the one before, and the lines (n,) found."""
    tracked, lines = commands, joints.shape[1]
    rows = np.arange(lines)
    predicted = start[np.zeros(lines, dtype=int)].in_shape(1, lines)
    for piece in range(len(joints)):
        actual, converged = robot.correct(joints[[piece]][:, rows], predicted)
        # Lines that fail are dropped: continuing them would cost more than all the others.
        rows, actual = rows[converged[0]], actual[:, converged[0]]
        if not len(rows):
            break
        tracked = tracked.with_rows((piece, rows), actual.in_shape(-1))
        if piece + 1 < len(joints):
            before, after = commands[piece : piece + 1, rows], commands[piece + 1 : piece + 2, rows]
            predicted = _predict(before, after, actual)
    return tracked, np.isin(np.arange(lines), rows)
