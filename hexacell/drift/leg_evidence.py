"""Which leg a change is of: the evidence for each leg, all its parameters together.

Several parameters of a leg do nearly the same to some records, and neighbouring legs similar things. The
evidence for a leg is therefore the sum of the marginal likelihoods of its parameters, each of which may
have changed by an amount with the standard deviation ``USUAL_CHANGE`` (Kass and Raftery, Bayes factors,
Journal of the American Statistical Association 90, 1995, 773-795).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.rotations import Array

USUAL_CHANGE = 0.1
"""mm; 0.05 and 0.5 name the same legs in nearly all cases."""

CERTAIN = 0.99
"""Probability that the leg which changed is among those that are named."""


def likeliest_leg(scores: Array, sigmas: Array, legs: NDArray[np.int_]) -> int:
    """The leg that changed, by the scores (m,) of single causes, their sigmas and their legs (m,)."""
    return possible_legs(scores, sigmas, legs)[0]


def possible_legs(scores: Array, sigmas: Array, legs: NDArray[np.int_]) -> tuple[int, ...]:
    """The legs of which one changed, the likeliest first: as few as have ``CERTAIN`` together."""
    with np.errstate(divide="ignore"):
        ratio = (USUAL_CHANGE / sigmas) ** 2
    return legs_by_evidence(0.5 * (scores**2 * ratio / (1.0 + ratio) - np.log1p(ratio)), legs)


def legs_by_evidence(evidence: Array, legs: NDArray[np.int_]) -> tuple[int, ...]:
    """The same by the logarithm of the evidence (m,) for each cause."""
    of_leg = {int(leg): float(np.logaddexp.reduce(evidence[legs == leg])) for leg in np.unique(legs)}
    ordered = sorted(of_leg, key=of_leg.__getitem__, reverse=True)
    total = np.logaddexp.reduce(list(of_leg.values()))
    together = np.cumsum([np.exp(of_leg[leg] - total) for leg in ordered])
    return tuple(ordered[: 1 + int(np.searchsorted(together, CERTAIN))])
