"""What came of many trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from hexacell.verdict.decision import Verdict
from tests.benchmarks.worlds.trials import Outcome

SURELY = 1e-3
"""Probability with which a figure that is exactly on its target is found beyond it by chance."""


@dataclass(frozen=True, slots=True)
class Totals:
    """Shares over trials with a geometry that could be judged, and over all."""

    outcomes: Sequence[Outcome]

    @property
    def judged(self) -> list[Outcome]:
        """Those with a geometry."""
        return [one for one in self.outcomes if one.verdict is not None]

    @property
    def covered(self) -> float:
        """Share whose error is within U of the stated one."""
        return float(np.mean([one.is_covered for one in self.judged]))

    @property
    def passes(self) -> int:
        """How many passed."""
        return sum(one.verdict is Verdict.PASS for one in self.outcomes)

    @property
    def false_passes(self) -> int:
        """How many of them err by more than the limit."""
        return sum(one.is_false_pass for one in self.outcomes)

    @property
    def false_passes_with_u(self) -> int:
        """How many would pass falsely with a guard band of U alone."""
        return sum(one.is_false_pass_with_u for one in self.outcomes)

    @property
    def wrongly_named(self) -> int:
        """In how many a cause was named that is not there."""
        return sum(one.is_wrongly_named for one in self.outcomes)


def most_by_chance(share: float, count: int) -> int:
    """The largest number out of ``count`` that agrees with a share."""
    return int(binom.isf(SURELY, count, share))


def least_by_chance(share: float, count: int) -> int:
    """The smallest number out of ``count`` that agrees with a share."""
    return int(binom.ppf(SURELY, count, share))
