"""The path back to a point's reference, decided move by move.

The path is planned from the last pose that was to be measured, and kept to while the robot is on it.
Planned again from a waypoint, it could lead back to where it came from, and from there to the waypoint,
endlessly.
Where no path can be planned the robot returns along its trail, cutting it short where a straight line to
an earlier pose is clear: the trail was clear on the way out.
"""

from __future__ import annotations

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.motion.path_check import is_clear
from hexacell.motion.waypoint_planner import PathPlanner

SAME_MM = 1e-6
SAME_ANGLE = float(np.radians(1e-6))
"""Commands that differ by less are the same, converted between frames."""


def next_return_move(belief: RobotBelief, reference: Array, trail: PoseBatch, departure: int) -> int | Pose:
    """The next move back to the reference: a row of the trail, or a waypoint beside it.

    Args:
        belief: what is known of the robot.
        reference: where the ball was when the gauges were zeroed (3,), mm.
        trail: commands (m, 2 at least) from the reference's own to the present one.
        departure: the row of the last command that is not a waypoint.
    """
    here, home = trail[[-1]], trail[[0]]
    (path,) = PathPlanner(belief, trail[[departure]], None, reference).plan(home)
    waypoints = () if path is None else path.waypoints
    line = PoseBatch.of([trail.pose(departure), *waypoints])
    if path is not None and _is_same(line, here).any():
        passed = int(np.argmax(_is_same(line, here)))
        return waypoints[passed] if passed < len(waypoints) else 0
    shortcuts = (row for row in range(len(trail) - 2) if is_clear(belief, here, trail[[row]], reference))
    return next(shortcuts, len(trail) - 2)


def _is_same(poses: PoseBatch, other: PoseBatch) -> Mask:
    distance = np.abs(poses.positions - other.positions).max(axis=-1)
    angle = np.abs(poses.rotations - other.rotations).max(axis=(-2, -1))
    same: Mask = (distance < SAME_MM) & (angle < SAME_ANGLE)
    return same
