"""A short way over poses: in which order they are visited between two ends that are given."""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations, pairwise

from hexacell.kinematics.rotations import Array

MOST_IMPROVED = 40
"""More poses are visited each from its nearest, a quarter longer: improving takes the square of it."""


def short_order(apart: Array, is_clear: Callable[[int, int], bool]) -> list[int] | None:
    """Rows 1 to n - 2 in an order in which the way from row 0 over them to row n - 1 is short.

    Always on to the nearest, and then shortened by turning parts of the way round (2-opt; Croes, A Method
    for Solving Traveling-Salesman Problems, 1958).

    Args:
        apart: what the way from one row to another takes (n, n), in any unit, as much there as back.
        is_clear: whether the line from one row to another may be gone.

    Returns:
        The order; None where a line that is needed is not clear.
    """
    may_go = cache(is_clear)
    order, last = [0], len(apart) - 1
    left = set(range(1, last))
    while left:
        open_rows = [row for row in left if may_go(order[-1], row)]
        if not open_rows:
            return None
        here = order[-1]
        order.append(min(open_rows, key=lambda row: float(apart[here, row])))
        left.remove(order[-1])
    order.append(last)
    if not may_go(*order[-2:]):
        return None
    while len(order) <= MOST_IMPROVED and (shorter := _turned_round(order, apart, may_go)):
        order = shorter
    return order[1:-1]


def _turned_round(
    order: Sequence[int], apart: Array, may_go: Callable[[int, int], bool]
) -> list[int] | None:
    """The order with a part of it turned round, if that is shorter and may be gone."""
    for first, end in combinations(range(1, len(order)), 2):
        before, after = order[first - 1], order[end]
        saved = apart[before, order[first]] + apart[order[end - 1], after]
        saved -= apart[before, order[end - 1]] + apart[order[first], after]
        if saved > 1e-9:
            shorter = [*order[:first], *reversed(order[first:end]), *order[end:]]
            if all(may_go(*pair) for pair in pairwise(shorter[first - 1 : end + 1])):
                return shorter
    return None
