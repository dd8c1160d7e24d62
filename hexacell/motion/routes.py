"""Routes over commands that are known already: between two commands, and back to a point's reference.

:func:`find_route` is a breadth-first search for the fewest straight lines. The edges of its graph are the
lines that pass :func:`hexacell.motion.path_check.is_clear`. An edge is checked only when the search needs
it, because a check costs far more than the search.

:func:`next_return_move` decides on the way back to a reference move by move. The path is planned from the
last pose that was to be measured, and kept while the robot is on it: planned again from a waypoint, it
could lead back and forth endlessly. Where no path can be planned the robot returns by the path on which
it came. A straight line to an earlier pose shortens that where it is clear.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.motion.path_check import is_clear
from hexacell.motion.waypoint_planner import PathPlanner

SAME_MM = 1e-6
SAME_ANGLE = float(np.radians(1e-6))
"""Commands that differ by less are the same, converted between frames."""


def find_route(
    belief: RobotBelief,
    start: PoseBatch,
    end: PoseBatch,
    via: Sequence[PoseBatch],
    reference: Array | None = None,
) -> list[int] | None:
    """The fewest straight lines from ``start`` to ``end``: the rows of ``via`` between them, in order.

    An empty list where the straight line itself is clear; none where there is no route. With gauges
    zeroed where the ball was at ``reference`` (3,), mm, the ball stays inside their travel.
    """
    queue: deque[list[int]] = deque([[]])
    unvisited = list(range(len(via)))
    while queue:
        route = queue.popleft()
        here = via[route[-1]] if route else start
        if is_clear(belief, here, end, reference):
            return route
        reached = [row for row in unvisited if is_clear(belief, here, via[row], reference)]
        unvisited = [row for row in unvisited if row not in reached]
        queue.extend([*route, row] for row in reached)
    return None


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
