"""A fixed list of poses instead of chosen ones: read from a file, visited where it is safe.

The file has the columns ``point,orientation,x,y,z,a,b,c`` of a measurement file, in the controller's
frames, mm and deg. Points are those of the cell file; a point's first row is its reference. The
other rows are visited in their order, but a pose at which the ball is not yet sure to stay inside
the travel waits until more is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexacell import kinematics
from hexacell.cell.file import Cell
from hexacell.design.candidates import within_limits
from hexacell.design.knowledge import Knowledge
from hexacell.design.next_pose import SAFETY_SIGMAS, TRAVEL_SHARE, Choice, Station
from hexacell.design.path import is_clear
from hexacell.errors import FileError, LimitError
from hexacell.identification.model import record_covariance
from hexacell.measurement_file import read_poses
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array

SAME_MM_DEG = 1e-6
"""Numbers of a pose that differ by less are the same number, written down once more."""


@dataclass(frozen=True, slots=True)
class PoseList:
    """Poses to visit at each point of a cell, in the controller's frames."""

    path: Path
    poses: tuple[tuple[Pose, ...], ...]

    def __len__(self) -> int:
        return sum(map(len, self.poses))

    def at(self, point: int) -> tuple[Pose, ...]:
        """Those of a point, its reference first."""
        return self.poses[point - 1]


def pose_list_of(cell: Cell) -> PoseList | None:
    """The list that a cell file names, relative to itself; none if poses are to be chosen.

    Raises:
        FileError: it cannot be read, or its points are not those of the cell file.
    """
    name = cell.settings.identification.poses
    if name is None:
        return None
    path = cell.path.parent / name
    points = len(cell.settings.identification.points)
    at_points: list[list[Pose]] = [[] for _ in range(points)]
    for line, point, pose in read_poses(path):
        if point > points:
            raise FileError(
                f"there is no point {point}, the cell file has {points}",
                subject=path,
                line=line,
                action="Correct the number, or add the point under [identification]",
            )
        at_points[point - 1].append(pose)
    for number, poses in enumerate(at_points, start=1):
        if len(poses) < 2:
            raise FileError(
                f"point {number} has {'one pose' if poses else 'no pose'}, two are the least",
                subject=path,
                action="Add poses, or take the point out of the cell file",
            )
    return PoseList(path, tuple(map(tuple, at_points)))


def not_among(poses: tuple[Pose, ...], visited: list[Pose]) -> tuple[Pose, ...]:
    """The poses that were not visited yet."""
    return tuple(pose for pose in poses if not any(_same(pose, other) for other in visited))


def _same(one: Pose, other: Pose) -> bool:
    return bool(np.abs(np.subtract(one.as_tuple(), other.as_tuple())).max() < SAME_MM_DEG)


def choose_listed(
    knowledge: Knowledge, at: Station, commands: Poses, present: Poses | None, passed_over: int
) -> Choice:
    """The first of some commands that is surely safe by now, after so many that were refused.

    Commands are in the mechanism's frame convention.

    Raises:
        LimitError: none of them is safe.
    """
    joints = knowledge.mechanism.inverse(knowledge.controller, knowledge.branch, commands)
    usable = np.flatnonzero(within_limits(knowledge.limits, commands, joints))
    commands, joints = commands[usable], joints[usable]
    really = kinematics.follow(
        knowledge.mechanism,
        knowledge.estimate,
        joints,
        start=commands,
        start_geometry=knowledge.controller,
        start_joints=joints,
    )
    rows = np.flatnonzero(really.found)
    commands, joints, poses = commands[rows], joints[rows], really.poses[rows]
    deviation, spread, noise = _expected(knowledge, at, poses, joints)
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    gain = 0.5 * (np.linalg.slogdet(spread)[1] - np.linalg.slogdet(noise)[1])
    reach = np.abs(deviation) + SAFETY_SIGMAS * sigma
    inside = (reach <= TRAVEL_SHARE * knowledge.limits.gauge_travel_mm).all(axis=-1)
    margin = kinematics.singularity_margin(knowledge.mechanism, knowledge.estimate, poses, joints)
    inside &= margin >= knowledge.limits.singularity_margin
    for row in np.flatnonzero(inside)[passed_over:]:
        command = commands[[int(row)]]
        if present is None or is_clear(knowledge, present, command, at.reference):
            return Choice(command.pose(0), joints[row], deviation[row], sigma[row], float(gain[row]))
    raise LimitError("none of the poses left in the list surely keeps the ball inside the gauges' travel")


def _expected(knowledge: Knowledge, at: Station, poses: Poses, joints: Array) -> tuple[Array, Array, Array]:
    """Deviations (n, 3), their covariances (n, 3, 3), and the noise's part of these."""
    sensitivity = kinematics.sensitivity(knowledge.mechanism, knowledge.estimate, poses, joints)
    change = sensitivity.parameters[:, :3] @ knowledge.basis - at.jacobian
    noise = record_covariance(sensitivity.joints[:, :3], knowledge.noise) + at.covariance
    spread = change @ knowledge.covariance @ np.swapaxes(change, -1, -2) + noise
    return poses.positions - at.reference, spread, noise
