"""A fixed list of poses instead of selected ones, read from a file and visited where it is safe.

The file has the columns ``point,orientation,x,y,z,a,b,c`` of a measurement file, in the controller's
frames, mm and deg. Points are those of the cell file; a point's first row is its reference. The
other rows are visited in their order. A pose at which the ball may leave the travel by what is known
so far is postponed until more is known.
"""

from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.errors import FileError
from hexacell.kinematics.pose import Pose
from hexacell.measurements.csv_file import read_poses


@dataclass(frozen=True, slots=True)
class PoseList:
    """Poses to visit at each point of a cell, in the controller's frames."""

    path: Path
    poses: tuple[tuple[Pose, ...], ...]

    def __len__(self) -> int:
        return sum(map(len, self.poses))

    def at(self, point: int) -> tuple[Pose, ...]:
        """The poses of a point, its reference first."""
        return self.poses[point - 1]


def pose_list_of(cell: Cell) -> PoseList | None:
    """The list that a cell file names, relative to itself; None if poses are to be selected.

    Poses that the cell file excludes are left out.

    Raises:
        FileError: it cannot be read, or its points are not those of the cell file.
    """
    if (name := cell.settings.identification.poses) is None:
        return None
    path = cell.path.parent / name
    points = len(cell.settings.identification.points)
    at_points: list[list[Pose]] = [[] for _ in range(points)]
    for line, point, pose in read_poses(path):
        if point > points:
            problem = f"there is no point {point}, the cell file has {points}"
            action = "Correct the number, or add the point under [identification]"
            raise FileError(problem, subject=path, line=line, action=action)
        at_points[point - 1].append(pose)
    for number, poses in enumerate(at_points, start=1):
        if len(poses) < 2:
            raise FileError(
                f"point {number} has {'one pose' if poses else 'no pose'}, two are the least",
                subject=path,
                action="Add poses, or take the point out of the cell file",
            )
    excluded = cell.settings.excluded_commands
    for number, poses in enumerate(at_points, start=1):
        if number not in cell.settings.excluded_points and not excluded.allows(poses[0].as_tuple()):
            raise FileError(
                f"an exclusion of {cell.path.name} contains the reference of point {number}",
                subject=path,
                action=f"Exclude the whole point: point = {number}",
            )
    kept = (tuple(pose for pose in poses if excluded.allows(pose.as_tuple())) for poses in at_points)
    return PoseList(path, tuple(kept))
