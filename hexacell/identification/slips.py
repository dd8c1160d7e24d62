"""A slipped zero: from some record of a point on, the gauges show a constant more than before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.expansion import Expansion
from hexacell.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class SlipTests:
    """Tests of a slip right before each of n records, at least two records before and after it.

    Attributes:
        rows: (k,) the first record after each slip that can be tested.
        gains: (k,) by how much the slip would lower the chi-square; about 3 where there is none.
        shifts: (k, 3), mm, what the gauges x, y and z would show more.
    """

    rows: NDArray[np.intp]
    gains: Array
    shifts: Array

    @classmethod
    def of(cls, expansion: Expansion) -> SlipTests:
        """All slips that the records of an expansion could show."""
        problem, weights = expansion.problem, expansion.weights
        rows = _testable(problem.first_rows, problem.records)
        score = _sums_from(problem.first_rows, expansion.scores)[rows]
        weight = _sums_from(problem.first_rows, weights)[rows]
        by_parameters = _sums_from(problem.first_rows, weights @ expansion.jacobian)[rows]
        whole = np.linalg.inv(problem.spread(problem.group_sums(weights))[rows])
        taken = by_parameters @ expansion.covariance @ np.swapaxes(by_parameters, -1, -2)
        information = weight - weight @ whole @ weight - taken
        shift = np.einsum("kij,kj->ki", np.linalg.pinv(information, hermitian=True), score)
        return cls(rows, np.sum(score * shift, axis=-1), -shift @ problem.gauges)


def _testable(first_rows: NDArray[np.intp], records: int) -> NDArray[np.intp]:
    """A lone first or last record that is shifted is a gross error, and found as such."""
    ends = np.append(first_rows[1:], records)
    spans = [np.arange(first + 2, end - 1) for first, end in zip(first_rows, ends, strict=True)]
    return np.concatenate(spans) if spans else np.zeros(0, dtype=np.intp)


def _sums_from(first_rows: NDArray[np.intp], values: Array) -> Array:
    """Sums (n, ...) over each record and the later ones of its point."""
    totals = np.add.reduceat(values, first_rows, axis=0)
    lengths = np.diff(np.append(first_rows, len(values)))
    before = np.cumsum(values, axis=0) - values
    at_start = np.repeat(before[first_rows], lengths, axis=0)
    sums: Array = np.repeat(totals, lengths, axis=0) - (before - at_start)
    return sums
