"""The way between two commanded poses, checked before it is taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell import kinematics, rotations
from hexacell.design.knowledge import Knowledge
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

PIECES = 12
MARGIN_SHARE = 0.5
"""Of the singularity margin, on the way. The ends keep all of it."""


def straight(start: Poses, end: Poses, pieces: int = PIECES) -> Poses:
    """The poses (pieces + 1) on a controller's straight line from one pose to another.

    Controllers move all six numbers x, y, z, a, b, c evenly (LinuxCNC's G0), angles included.
    """
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None, None]
    begin, ends = (rotations.to_angles(poses.rotations) for poses in (start, end))
    positions = (1.0 - share) * start.positions[:1] + share * end.positions
    angles = (1.0 - share) * begin[:1] + share * ends
    return Poses(positions.reshape(-1, 3), rotations.from_angles(angles.reshape(-1, 3)))


def is_clear(knowledge: Knowledge, start: Poses, end: Poses, reference: Array | None = None) -> bool:
    """Whether the straight line between two commands keeps to the limits; see :func:`look_ahead`."""
    return bool(look_ahead(knowledge, start, end, reference).clear[0])


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
    """Straight lines (n) from one command to others, as the estimated robot would go them.

    Attributes:
        clear: (n,) which of them keep to the limits.
        joints: (pieces + 1, n, 6), mm.
        poses: ((pieces + 1) n), piece by piece; of lines that are not clear they say nothing.
        farthest: (n,), mm, along any axis: how far the ball gets from the reference; 0 without one.
    """

    clear: Mask
    joints: Array
    poses: Poses
    farthest: Array

    def way(self, row: int) -> tuple[Poses, Array]:
        """The poses on one of the lines after its beginning, and their joint variables."""
        pieces, count = self.joints.shape[:2]
        return self.poses[np.arange(1, pieces) * count + row], self.joints[1:, row]


def look_ahead(knowledge: Knowledge, start: Poses, ends: Poses, reference: Array | None = None) -> Ahead:
    """Straight lines (n) from one command to others.

    Joint ranges and the singularity margin hold all along a clear one, by the controller's geometry
    and by the estimated one. With the gauges at a ``reference`` (3,), mm, the ball stays inside their
    travel.
    """
    ways = straight(start, ends)
    joints = knowledge.mechanism.inverse(knowledge.controller, knowledge.branch, ways)
    joints = joints.reshape(PIECES + 1, len(ends), 6)
    limits = knowledge.limits
    in_range = (joints >= limits.joint_min_mm) & (joints <= limits.joint_max_mm)
    rows = np.flatnonzero(in_range.all(axis=(0, 2)))
    lines = _Lines.of(ways, len(ends))
    if len(rows):
        rows = rows[_controller_keeps_clear(knowledge, lines, joints, rows)]
    if not len(rows):
        return Ahead(np.zeros(len(ends), dtype=bool), joints, ways, np.zeros(len(ends)))
    return _followed(knowledge, lines, joints, rows, reference)


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Positions (pieces + 1, n, 3) and rotations (pieces + 1, n, 3, 3) on n lines."""

    positions: Array
    rotations: Array

    @classmethod
    def of(cls, poses: Poses, count: int) -> _Lines:
        """Copies of poses that come piece by piece."""
        shape = (-1, count, 3)
        return cls(np.array(poses.positions).reshape(shape), np.array(poses.rotations).reshape(*shape, 3))

    def at(self, piece: int, rows: NDArray[np.intp]) -> Poses:
        """The poses on some lines after so many pieces."""
        return Poses(self.positions[piece, rows], self.rotations[piece, rows])

    def put(self, piece: int, rows: NDArray[np.intp], poses: Poses) -> None:
        """Poses on some lines after so many pieces."""
        self.positions[piece, rows], self.rotations[piece, rows] = poses.positions, poses.rotations

    def flat(self, rows: NDArray[np.intp] | slice = slice(None)) -> Poses:
        """Some lines' poses piece by piece."""
        positions, rotations = self.positions[:, rows], self.rotations[:, rows]
        return Poses(positions.reshape(-1, 3), rotations.reshape(-1, 3, 3))


def _controller_keeps_clear(
    knowledge: Knowledge, ways: _Lines, joints: Array, rows: NDArray[np.intp]
) -> Mask:
    """Which of some commanded lines are clear of singularities by the controller's own geometry."""
    arguments = (knowledge.mechanism, knowledge.controller, ways.flat(rows), joints[:, rows].reshape(-1, 6))
    # Between two of the poses looked at a singularity may lie unseen; beyond it the mode is another.
    mode = kinematics.assembly_mode(kinematics.pose_jacobian(*arguments)).reshape(-1, len(rows))
    margin = kinematics.singularity_margin(*arguments).reshape(-1, len(rows))
    far_enough = (margin >= MARGIN_SHARE * knowledge.limits.singularity_margin).all(axis=0)
    clear: Mask = far_enough & (mode == mode[:1]).all(axis=0)
    return clear


def _followed(
    knowledge: Knowledge, ways: _Lines, joints: Array, rows: NDArray[np.intp], reference: Array | None
) -> Ahead:
    """The estimated robot led along some lines, piece after piece as the real one goes them."""
    count = joints.shape[1]
    really = _Lines(ways.positions.copy(), ways.rotations.copy())
    farthest = np.zeros(count)
    first = kinematics.follow(
        knowledge.mechanism,
        knowledge.estimate,
        joints[0, :1],
        start=ways.at(0, np.array([0])),
        start_geometry=knowledge.controller,
        start_joints=joints[0, :1],
    )
    mode = kinematics.assembly_mode(
        kinematics.pose_jacobian(knowledge.mechanism, knowledge.estimate, first.poses, joints[0, :1])
    )
    rows = rows if first.found[0] else rows[:0]
    start = first.poses[np.zeros(len(rows), dtype=int)]
    for piece in range(PIECES + 1):
        if not len(rows):
            break
        found = kinematics.forward(
            knowledge.mechanism, knowledge.estimate, joints[piece, rows], start, mode=mode.repeat(len(rows))
        )
        fits = found.found & _keeps_margin(knowledge, found.poses, joints[piece, rows])
        if reference is not None:
            away = np.abs(found.poses.positions - reference).max(axis=-1)
            farthest[rows] = np.maximum(farthest[rows], away)
            fits &= away <= knowledge.limits.gauge_travel_mm
        # What is not clear is not led on: it would cost more than all the others.
        rows = rows[fits]
        really.put(piece, rows, found.poses[fits])
        if piece < PIECES:
            start = _carried_on(ways, really, piece, rows)
    clear = np.zeros(count, dtype=bool)
    clear[rows] = True
    return Ahead(clear, joints, really.flat(), farthest)


def _keeps_margin(knowledge: Knowledge, poses: Poses, joints: Array) -> Mask:
    margin = kinematics.singularity_margin(knowledge.mechanism, knowledge.estimate, poses, joints)
    keeps: Mask = margin >= MARGIN_SHARE * knowledge.limits.singularity_margin
    return keeps


def _carried_on(ways: _Lines, really: _Lines, piece: int, rows: NDArray[np.intp]) -> Poses:
    """Where the robot will be after the next piece, if it moves as the command does."""
    here, before, after = really.at(piece, rows), ways.at(piece, rows), ways.at(piece + 1, rows)
    turns = after.rotations @ np.swapaxes(before.rotations, -1, -2)
    return Poses(here.positions + after.positions - before.positions, turns @ here.rotations)
