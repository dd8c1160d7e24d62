"""Straight lines of commands, and where a robot really goes while its controller follows them."""

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
PIECES_BETWEEN_STOPS = 4

CLOSE_MM = 1e-4
"""So well the poses on a line are known; travel is checked in tenths of a millimetre."""

JUMP_MM = 20.0
JUMP = np.radians(10.0)
"""What a robot may move otherwise than commanded in a piece of a line and be believed."""


def interpolate_line(start: PoseBatch, end: PoseBatch, pieces: int = PIECES) -> PoseBatch:
    """The poses (pieces + 1) on a controller's straight line from one pose to another.

    Controllers move all six numbers x, y, z, a, b, c evenly (LinuxCNC's G0), angles included. Of n
    lines, with one start or n of them, the poses come piece by piece.
    """
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None, None]
    begin, ends = (rotations.to_angles(poses.rotations) for poses in (start, end))
    positions = (1.0 - share) * start.positions + share * end.positions
    angles = (1.0 - share) * begin + share * ends
    return PoseBatch(positions.reshape(-1, 3), rotations.from_angles(angles.reshape(-1, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class LineBatch:
    """Poses one after the other on n lines.

    Attributes:
        positions: (pieces + 1, n, 3), mm.
        rotations: (pieces + 1, n, 3, 3).
    """

    positions: Array
    rotations: Array

    @classmethod
    def from_poses(cls, poses: PoseBatch, count: int) -> LineBatch:
        """Of poses that come piece by piece."""
        return cls(poses.positions.reshape(-1, count, 3), poses.rotations.reshape(-1, count, 3, 3))

    @classmethod
    def through(cls, stops: Sequence[PoseBatch], times: int = 1) -> LineBatch:
        """From stop to stop, of which there are one or n at a time, by straight lines.

        In so many ``times`` the pieces that these lines have as a rule.
        """
        pieces = times * (PIECES if len(stops) == 2 else PIECES_BETWEEN_STOPS)
        count = len(stops[-1])
        parts = [
            cls.from_poses(interpolate_line(here, there, pieces), count) for here, there in pairwise(stops)
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
        """The poses after some pieces."""
        return LineBatch(self.positions[pieces], self.rotations[pieces])

    def at(self, piece: int, rows: NDArray[np.intp]) -> PoseBatch:
        """The poses on some lines after so many pieces."""
        return PoseBatch(self.positions[piece, rows], self.rotations[piece, rows])

    def lines(self, rows: NDArray[np.intp]) -> LineBatch:
        """Some of them."""
        return LineBatch(self.positions[:, rows], self.rotations[:, rows])

    def flat(self) -> PoseBatch:
        """All poses, piece by piece."""
        return PoseBatch(self.positions.reshape(-1, 3), self.rotations.reshape(-1, 3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class TracedPath:
    """Where a robot goes on n lines.

    Attributes:
        actual: of lines that are not ``found`` it says nothing.
        found: (n,) along which of them it can go, and stays on its assembly mode.
    """

    actual: LineBatch
    found: Mask


def trace_path(
    mechanism: Mechanism,
    geometry: Geometry,
    commands: LineBatch,
    joints: Array,
    here: PoseBatch,
    *,
    thorough: bool = True,
) -> TracedPath:
    """Where a robot goes while its controller moves the sliders (pieces + 1, n, 6), mm, along lines.

    ``here`` (1) is where it is at the start of all of them. Each pose is the one that is found from
    the pose before it. All are searched for at once, from where the robot would be if it moved as
    commanded; where they move far otherwise, each is found again from the one before. Lines on which
    that differs, a few in a hundred, are followed step by step if it is to be ``thorough``, else given
    up.
    """
    jacobian = pose_jacobian(mechanism, geometry, here, joints[0, :1])
    robot = _Robot(mechanism, geometry, assembly_mode(jacobian))
    begin = _carried(commands[:1], commands, LineBatch.from_poses(here, 1))
    found, reached = robot.found(joints, begin)
    sure: Mask = np.all(reached, axis=0)
    jumping = np.flatnonzero(sure & _jumps(commands, found))
    if len(jumping):
        sure[jumping] = robot.confirmed(joints[:, jumping], commands.lines(jumping), found.lines(jumping))
    doubtful = np.flatnonzero(~sure)
    if not (thorough and len(doubtful)):
        return TracedPath(found, sure)
    stepped, went = _step_by_step(robot, commands.lines(doubtful), joints[:, doubtful], here)
    positions, turns = found.positions.copy(), found.rotations.copy()
    positions[:, doubtful], turns[:, doubtful] = stepped.positions, stepped.rotations
    sure[doubtful] = went
    return TracedPath(LineBatch(positions, turns), sure)


@dataclass(frozen=True, slots=True, eq=False)
class _Robot:
    """A robot on one of its assembly modes, the sign ``mode`` (1,) of its Jacobian's determinant."""

    mechanism: Mechanism
    geometry: Geometry
    mode: Array

    def found(self, joints: Array, start: LineBatch) -> tuple[LineBatch, Mask]:
        """Poses of joint variables (m, n, 6), mm, from nearby ones, and which were found (m, n)."""
        shape = joints.shape[:2]
        result = forward_kinematics(
            self.mechanism,
            self.geometry,
            joints.reshape(-1, 6),
            start.flat(),
            mode=self.mode.repeat(shape[0] * shape[1]),
            close_mm=CLOSE_MM,
        )
        return LineBatch.from_poses(result.poses, shape[1]), result.found.reshape(shape)

    def confirmed(self, joints: Array, commands: LineBatch, poses: LineBatch) -> Mask:
        """On which lines (n,) each pose is found from the one before."""
        again, found = self.found(joints[1:], _carried(commands[:-1], commands[1:], poses[:-1]))
        same = np.abs(again.positions - poses.positions[1:]).max(axis=-1) < 10.0 * CLOSE_MM
        confirmed: Mask = (same & found).all(axis=0)
        return confirmed


def _jumps(commands: LineBatch, poses: LineBatch) -> Mask:
    """On which lines (n,) the robot moves so far otherwise than commanded that it may have jumped.

    From one solution of the forward kinematics to another; these lie farther apart.
    """
    carried = _carried(commands[:-1], commands[1:], poses[:-1])
    away = np.linalg.norm(poses.positions[1:] - carried.positions, axis=-1)
    cosine = 0.5 * (np.einsum("mnij,mnij->mn", poses.rotations[1:], carried.rotations) - 1.0)
    jumps: Mask = ((away > JUMP_MM) | (cosine < np.cos(JUMP))).any(axis=0)
    return jumps


def _carried(before: LineBatch, after: LineBatch, real: LineBatch) -> LineBatch:
    """Where the robot will be if it moves as the command does, from ``before`` to ``after``."""
    turns = after.rotations @ np.swapaxes(before.rotations, -1, -2)
    return LineBatch(real.positions + after.positions - before.positions, turns @ real.rotations)


def _step_by_step(
    robot: _Robot, commands: LineBatch, joints: Array, here: PoseBatch
) -> tuple[LineBatch, Mask]:
    really = LineBatch(commands.positions.copy(), commands.rotations.copy())
    rows = np.arange(joints.shape[1])
    start = LineBatch.from_poses(here[np.zeros(len(rows), dtype=int)], len(rows))
    for piece in range(len(joints)):
        found, went = robot.found(joints[[piece]][:, rows], start)
        # What cannot be followed is not led on: it would cost more than all the others.
        kept = went[0]
        rows, found = rows[kept], found.lines(np.flatnonzero(kept))
        if not len(rows):
            break
        really.positions[piece, rows] = found.positions[0]
        really.rotations[piece, rows] = found.rotations[0]
        if piece + 1 < len(joints):
            now, then = commands[piece : piece + 1], commands[piece + 1 : piece + 2]
            start = _carried(now.lines(rows), then.lines(rows), found)
    return really, np.isin(np.arange(joints.shape[1]), rows)
