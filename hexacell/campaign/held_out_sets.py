"""The sets of poses at the held-out points, chosen as soon as the geometry is identified."""

from collections.abc import Iterator

from hexacell.cell.model import CellSettings
from hexacell.design.candidates import orientations
from hexacell.design.validation_poses import select_validation_poses
from hexacell.errors import LimitError
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot

SHARES = (0.0, 1.0 / 3.0, 2.0 / 3.0)
"""Shares of the way to the middle, by which a point is moved that the robot has too few poses at."""


def held_out_sets(
    robot: Robot, settings: CellSettings, found: Identification, turns: Array, count: int
) -> Iterator[PoseBatch | LimitError]:
    """``count`` poses at each held-out point, or why the robot has too few.

    They are selected of the candidates ``turns`` (n, 3, 3).

    Where a point has too few, because the ball would leave the travel or the robot its limits, they are at
    one nearer to the middle of the points that the geometry is identified at.
    """
    belief, wanted, used = robot.belief(found), settings.verification, found.poses.rotations
    own = robot.from_commands(Pose(*point) for point in settings.identification.points).positions
    for ball in robot.from_commands(Pose(*point) for point in wanted.points).positions:
        failures: list[LimitError] = []
        for share in SHARES:
            moved = ball + share * (own.mean(axis=0) - ball)
            try:
                yield select_validation_poses(belief, moved, count, turns, used)
                break
            except LimitError as error:
                failures.append(error)
        else:
            yield failures[0]


def held_out_turns(robot: Robot, settings: CellSettings, count: int, added_seed: int = 0) -> Array:
    """So many orientations (n, 3, 3), of which those of held-out poses are chosen."""
    limits, seed = robot.limits, settings.verification.seed + added_seed
    return orientations(count, limits.tilt, seed, most_twist=limits.turn)
