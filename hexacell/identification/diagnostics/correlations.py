"""Strong correlations between identified parameters.

With a correlation near 1 or -1, the difference or sum of two parameters is known well and each parameter
poorly. The geometry may still be accurate, but a change identified in one of the two may be a change
of the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.solver.result import Identification

STRONG = 0.9


@dataclass(frozen=True, slots=True)
class CorrelatedPair:
    """The names of two free parameters, e.g. ``l3`` and ``B3z``, and their correlation."""

    first: str
    second: str
    correlation: float


def strongly_correlated(found: Identification, above: float = STRONG) -> tuple[CorrelatedPair, ...]:
    """Pairs of free parameters with an absolute correlation above ``above``, the strongest first."""
    names = found.problem.mechanism.convention.free_names()
    sigma = np.sqrt(np.diag(found.free_covariance))
    correlation = found.free_covariance / np.outer(sigma, sigma)
    rows, columns = np.triu_indices(len(names), 1)
    strengths = np.abs(correlation[rows, columns])
    order = np.argsort(-strengths, kind="stable")
    return tuple(
        CorrelatedPair(names[i], names[j], float(correlation[i, j]))
        for i, j in zip(rows[order], columns[order], strict=True)
        if abs(correlation[i, j]) > above
    )
