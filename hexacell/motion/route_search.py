"""A way between two commanded poses in straight lines, each of them checked, round by others if need be."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import is_clear, start_state


def find_route(
    belief: RobotBelief,
    start: PoseBatch,
    goal: PoseBatch,
    via: Sequence[PoseBatch],
    reference: Array | None = None,
) -> list[int] | None:
    """The fewest straight lines from ``start`` to ``goal``: the rows of ``via`` that lie between.

    Every line is clear in the sense of :func:`hexacell.motion.path_check.is_clear`. Nothing where there is
    no such way; an empty list where the straight line itself is clear.
    """

    def clear(one: PoseBatch, other: PoseBatch) -> bool:
        return is_clear(belief, one, other, reference)

    return _fewest(start, goal, via, clear)


def ball_position(belief: RobotBelief, command: PoseBatch) -> Array | None:
    """Where the estimate says the ball is (3,), mm, at a commanded pose; nothing if it cannot say."""
    really = start_state(belief, command).actual
    return None if really is None else np.asarray(really.positions[0])


def _fewest(
    start: PoseBatch,
    goal: PoseBatch,
    via: Sequence[PoseBatch],
    clear: Callable[[PoseBatch, PoseBatch], bool],
) -> list[int] | None:
    """Breadth first, the goal tried before anything else."""
    waiting: deque[list[int]] = deque([[]])
    unseen = list(range(len(via)))
    while waiting:
        way = waiting.popleft()
        here = via[way[-1]] if way else start
        if clear(here, goal):
            return way
        reached = [row for row in unseen if clear(here, via[row])]
        unseen = [row for row in unseen if row not in reached]
        waiting.extend([*way, row] for row in reached)
    return None
