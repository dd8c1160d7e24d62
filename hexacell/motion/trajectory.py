"""Straight lines of commands, and the actual path of a robot under its controller.

The controller interpolates the command linearly. The actual pose at each point of the line closes the
robot's own geometry at the joint variables that the controller computes; it is found by path tracking
with a predictor and a corrector (Allgower & Georg, Numerical Continuation Methods, 1990). The predictor
moves the last actual pose by the change of the command, the corrector is Newton's method.

Tracking point by point is slow for many lines, so :func:`trace_path` first corrects all points of all
lines at once, each predicted from the start of its line. That is exact wherever Newton's method stays on
the branch. Lines that may have left it are verified, and tracked point by point if that fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics import rotations
from hexacell.kinematics.forward import assembly_mode, forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_jacobian

PIECES = 12
PIECES_BETWEEN_WAYPOINTS = 4
"""Pieces that a line is divided into."""

TOLERANCE_MM = 1e-4
"""Of the constraints at the poses of a line; gauge travel is checked in tenths of a millimetre."""

JUMP_MM = 20.0
JUMP_ANGLE = np.radians(10.0)
"""Largest difference, within a piece of a line, between the motion of the robot and of the command.
A larger one may be a jump to another solution."""


def interpolate_line(start: PoseBatch, end: PoseBatch, pieces: int = PIECES) -> PoseBatch:
    """The poses on a controller's straight lines, ``pieces + 1`` a line.

    Controllers interpolate all six numbers x, y, z, a, b, c linearly, angles included (LinuxCNC's G0).
    ``end`` has n poses and ``start`` one or n. The poses of n lines are ordered by piece, then by line.
    """
    fraction = np.linspace(0.0, 1.0, pieces + 1)[:, None, None]
    start_angles, end_angles = (rotations.to_angles(poses.rotations) for poses in (start, end))
    positions = (1.0 - fraction) * start.positions + fraction * end.positions
    angles = (1.0 - fraction) * start_angles + fraction * end_angles
    return PoseBatch(positions.reshape(-1, 3), rotations.from_angles(angles.reshape(-1, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class LineBatch:
    """Poses along n lines.

    Attributes:
        positions: (pieces + 1, n, 3), mm.
        rotations: (pieces + 1, n, 3, 3).
    """

    positions: Array
    rotations: Array

    @classmethod
    def from_poses(cls, poses: PoseBatch, count: int) -> LineBatch:
        """``count`` lines from poses that are ordered by piece, then by line."""
        return cls(poses.positions.reshape(-1, count, 3), poses.rotations.reshape(-1, count, 3, 3))

    @classmethod
    def through(cls, waypoints: Sequence[PoseBatch], refinement: int = 1) -> LineBatch:
        """Straight lines from waypoint to waypoint, one or n poses each; n at the end.

        ``refinement`` multiplies the usual number of pieces.
        """
        pieces = refinement * (PIECES if len(waypoints) == 2 else PIECES_BETWEEN_WAYPOINTS)
        count = len(waypoints[-1])
        parts = [
            cls.from_poses(interpolate_line(start, end, pieces), count)
            for start, end in pairwise(waypoints)
        ]
        return cls(
            np.concatenate([parts[0].positions[:1], *(part.positions[1:] for part in parts)]),
            np.concatenate([parts[0].rotations[:1], *(part.rotations[1:] for part in parts)]),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(pieces + 1, n)."""
        return self.positions.shape[0], self.positions.shape[1]

    def __getitem__(self, pieces: slice) -> LineBatch:
        return LineBatch(self.positions[pieces], self.rotations[pieces])

    def at(self, piece: int, rows: NDArray[np.intp]) -> PoseBatch:
        """The poses of some lines at the end of a piece."""
        return PoseBatch(self.positions[piece, rows], self.rotations[piece, rows])

    def lines(self, rows: NDArray[np.intp]) -> LineBatch:
        """Some of the lines."""
        return LineBatch(self.positions[:, rows], self.rotations[:, rows])

    def flat(self) -> PoseBatch:
        """All poses, ordered by piece, then by line."""
        return PoseBatch(self.positions.reshape(-1, 3), self.rotations.reshape(-1, 3, 3))

    def with_lines(self, rows: NDArray[np.intp], lines: LineBatch) -> LineBatch:
        """A copy in which ``lines`` replace those in ``rows``."""
        positions, turns = self.positions.copy(), self.rotations.copy()
        positions[:, rows], turns[:, rows] = lines.positions, lines.rotations
        return LineBatch(positions, turns)


@dataclass(frozen=True, slots=True, eq=False)
class TracedPath:
    """The actual path of a robot along n lines.

    Attributes:
        actual: poses; undefined on lines that are not ``found``.
        found: (n,) lines along which the robot stays on its assembly mode.
    """

    actual: LineBatch
    found: Mask


def trace_path(
    mechanism: Mechanism,
    geometry: Geometry,
    commands: LineBatch,
    joints: Array,
    start: PoseBatch,
    *,
    thorough: bool = True,
) -> TracedPath:
    """The actual path of a robot whose joints move through (pieces + 1, n, 6), mm, along n lines.

    ``start`` (1) is the actual pose at the start of all lines. Lines on which poses from one parallel
    correction cannot be confirmed, a few in a hundred, are tracked point by point if ``thorough``, else
    they count as not found.
    """
    jacobian = pose_jacobian(mechanism, geometry, start, joints[0, :1])
    robot = _Robot(mechanism, geometry, assembly_mode(jacobian))
    predicted = _predict(commands[:1], commands, LineBatch.from_poses(start, 1))
    actual, converged = robot.correct(joints, predicted)
    confirmed: Mask = np.all(converged, axis=0)
    suspect = np.flatnonzero(confirmed & _may_have_jumped(commands, actual))
    if len(suspect):
        confirmed[suspect] = robot.confirm(
            joints[:, suspect], commands.lines(suspect), actual.lines(suspect)
        )
    open_rows = np.flatnonzero(~confirmed)
    if not (thorough and len(open_rows)):
        return TracedPath(actual, confirmed)
    tracked = _track(robot, commands.lines(open_rows), joints[:, open_rows], start)
    confirmed[open_rows] = tracked.found
    return TracedPath(actual.with_lines(open_rows, tracked.actual), confirmed)


@dataclass(frozen=True, slots=True, eq=False)
class _Robot:
    """A robot on one assembly mode: the sign ``mode`` (1,) of its Jacobian's determinant."""

    mechanism: Mechanism
    geometry: Geometry
    mode: Array

    def correct(self, joints: Array, predicted: LineBatch) -> tuple[LineBatch, Mask]:
        """Newton's method from predicted poses at joints (m, n, 6), mm; which converged (m, n)."""
        shape = joints.shape[:2]
        result = forward_kinematics(
            self.mechanism,
            self.geometry,
            joints.reshape(-1, 6),
            predicted.flat(),
            mode=self.mode.repeat(shape[0] * shape[1]),
            tolerance_mm=TOLERANCE_MM,
        )
        return LineBatch.from_poses(result.poses, shape[1]), result.found.reshape(shape)

    def confirm(self, joints: Array, commands: LineBatch, actual: LineBatch) -> Mask:
        """On which lines (n,) each pose is found again from the pose before it."""
        again, converged = self.correct(joints[1:], _predict(commands[:-1], commands[1:], actual[:-1]))
        same = np.abs(again.positions - actual.positions[1:]).max(axis=-1) < 10.0 * TOLERANCE_MM
        confirmed: Mask = np.all(converged & same, axis=0)
        return confirmed


def _may_have_jumped(commands: LineBatch, actual: LineBatch) -> Mask:
    """On which lines (n,) the actual motion within a piece is far from the commanded one.

    It may be a jump to another solution of the forward kinematics; these are farther apart.
    """
    predicted = _predict(commands[:-1], commands[1:], actual[:-1])
    distance = np.linalg.norm(actual.positions[1:] - predicted.positions, axis=-1)
    cosine = 0.5 * (np.einsum("mnij,mnij->mn", actual.rotations[1:], predicted.rotations) - 1.0)
    suspect: Mask = ((distance > JUMP_MM) | (cosine < np.cos(JUMP_ANGLE))).any(axis=0)
    return suspect


def _predict(before: LineBatch, after: LineBatch, actual: LineBatch) -> LineBatch:
    """Actual poses moved by the change of the command from ``before`` to ``after``."""
    turns = after.rotations @ np.swapaxes(before.rotations, -1, -2)
    return LineBatch(actual.positions + after.positions - before.positions, turns @ actual.rotations)


def _track(robot: _Robot, commands: LineBatch, joints: Array, start: PoseBatch) -> TracedPath:
    """The lines point by point, each point predicted from the one before."""
    positions, turns = commands.positions.copy(), commands.rotations.copy()
    rows = np.arange(joints.shape[1])
    predicted = LineBatch.from_poses(start[np.zeros(len(rows), dtype=int)], len(rows))
    for piece in range(len(joints)):
        actual, converged = robot.correct(joints[[piece]][:, rows], predicted)
        # Lines that fail are dropped: continuing them would cost more than all the others.
        rows, actual = rows[converged[0]], actual.lines(np.flatnonzero(converged[0]))
        if not len(rows):
            break
        positions[piece, rows], turns[piece, rows] = actual.positions[0], actual.rotations[0]
        if piece + 1 < len(joints):
            before, after = commands[piece : piece + 1], commands[piece + 1 : piece + 2]
            predicted = _predict(before.lines(rows), after.lines(rows), actual)
    return TracedPath(LineBatch(positions, turns), np.isin(np.arange(joints.shape[1]), rows))
