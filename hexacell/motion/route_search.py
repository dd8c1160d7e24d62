"""Routes of straight lines between two commands over given intermediate commands.

The shortest route by number of lines is found by breadth-first search on the graph whose edges are the
lines that pass :func:`hexacell.motion.path_check.is_clear`. Edges are checked only when the search needs
them, because a check costs far more than the search.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import is_clear


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
