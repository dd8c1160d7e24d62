"""Orders in which poses are visited: short, complete, and along clear lines only."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from hexacell.design.short_order import MOST_IMPROVED, short_order


def apart_of(places: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(places[:, None] - places, axis=-1))


def length(apart: np.ndarray, order: list[int]) -> float:
    return float(sum(apart[pair] for pair in pairwise([0, *order, len(apart) - 1])))


@pytest.mark.parametrize("seed", range(8))
def test_it_is_nearly_the_shortest(seed: int) -> None:
    places = np.random.default_rng(seed).uniform(size=(9, 2))
    apart = apart_of(places)
    order = short_order(apart, lambda *_: True)
    assert order is not None
    assert sorted(order) == list(range(1, 8))
    best = min(length(apart, list(one)) for one in permutations(range(1, 8)))
    assert length(apart, order) <= 1.15 * best


def test_lines_that_are_not_clear_are_not_gone() -> None:
    places = np.random.default_rng(3).uniform(size=(10, 2))
    blocked = {(1, 2), (2, 1), (4, 7), (7, 4), (3, 9)}
    order = short_order(apart_of(places), lambda start, end: (start, end) not in blocked)
    assert order is not None
    assert not blocked & set(pairwise([0, *order, 9]))
    assert short_order(apart_of(places), lambda _, end: end != 5) is None, "5 cannot be gone to"
    assert short_order(apart_of(places), lambda _, end: end != 9) is None, "nothing leads home"


def test_many_are_visited_each_from_its_nearest() -> None:
    apart = apart_of(np.random.default_rng(4).uniform(size=(MOST_IMPROVED + 60, 2)))
    order = short_order(apart, lambda *_: True)
    assert order is not None
    assert sorted(order) == list(range(1, len(apart) - 1))
    assert short_order(apart[:2, :2], lambda *_: True) == []
