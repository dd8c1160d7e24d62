"""What the largest of several correlated scores exceeds by chance."""

from __future__ import annotations

import numpy as np

from hexacell.distributions import normal_limit
from hexacell.kinematics.rotations import Array

FALSE_ALARMS = 0.01
"""Probability of an alarm for an unchanged robot."""

DRAWS = 40_000
"""Of the scores; the probability of a false alarm is then known to 5 % of itself."""


def largest_by_chance(unit: Array) -> float:
    """The limit of the largest of m scores, exceeded with probability ``FALSE_ALARMS``.

    The scores are standard normal; the products of the columns of ``unit`` (r, m) are their correlations.
    """
    draws = np.random.default_rng(0).standard_normal((DRAWS, min(unit.shape)))
    factor = np.linalg.qr(unit)[1] if len(unit) > unit.shape[1] else unit
    largest = np.concatenate([np.abs(part @ factor).max(axis=1) for part in np.array_split(draws, 10)])
    return float(np.quantile(largest, 1.0 - FALSE_ALARMS))


def largest_of_independent(scores: int) -> float:
    """The same of so many scores whose correlations nobody looks at: it is exceeded no more often."""
    return normal_limit(0.5 * FALSE_ALARMS / scores)
