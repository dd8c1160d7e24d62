"""How fast a parameter changes steadily, each taken alone, by all runs together.

A drift by v a day along a cause d, from a first time on, adds ``t v N d`` to what a run t days later
weighs. As for a step (:mod:`~hexacell.drift.step_location`), with the state unknown too, the
most likely rate is

    v = u / w,    u = d^T sum t g,    w = d^T (sum t^2 N - B T^-1 B) d,    B = sum t N,

with the gradients g at the estimate of all runs under no change, and the information T of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.drift.carried_posterior import LEAST_SHARE, CarriedPosterior
from hexacell.drift.largest_score import largest_of_independent
from hexacell.drift.moving_posterior import MovingPosterior
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class SteadyDrift:
    """The rates (m,) by each cause, in its unit a day, and one standard deviation of each.

    It is infinite of a cause that the runs do not see.
    """

    rates: Array
    sigmas: Array

    @property
    def scores(self) -> Array:
        """(m,) standard normal if nothing drifts."""
        scores: Array = self.rates / self.sigmas
        return scores

    @property
    def limit(self) -> float:
        """What the largest score exceeds by chance in one case of a hundred, at most."""
        return largest_of_independent(len(self.rates))


def steady_drift_of_each(
    before: MovingPosterior, runs: Sequence[RunEvidence], days: Sequence[float]
) -> SteadyDrift:
    """The rates of all causes on the ``days`` (n) of runs, by what is known before them.

    Nothing that was said before of the rates of a leg counts for it; other legs may move on meanwhile.
    """
    causes, since = before.causes, np.array(days) - before.day
    rates, sigmas = np.zeros(len(causes.legs)), np.zeros(len(causes.legs))
    for leg in np.unique(causes.legs).tolist():
        known, rows = before.without_rates((leg,)), causes.legs == leg
        seen = [known.seen(run, day) for run, day in zip(runs, days, strict=True)]
        found = steady_drift(known.posterior, seen, since, known.by_state[rows])
        rates[rows], sigmas[rows] = found.rates, found.sigmas
    return SteadyDrift(rates, sigmas)


def steady_drift(
    before: CarriedPosterior, runs: Sequence[RunEvidence], days: Array, causes: Array
) -> SteadyDrift:
    """The rates by m causes (m, s), from runs ``days`` (n,) after what is known ``before`` them."""
    total = before
    for run in runs:
        total = total.after(run)
    state, covariance = total.state, np.linalg.inv(total.evidence.information)
    gradient = np.sum([t * run.gradient(state) for run, t in zip(runs, days, strict=True)], axis=0)
    moved = np.sum([t * run.information for run, t in zip(runs, days, strict=True)], axis=0) @ causes.T
    squares = np.sum([t * t * run.information for run, t in zip(runs, days, strict=True)], axis=0)
    own = np.einsum("ms,st,mt->m", causes, squares, causes)
    weight = own - np.einsum("sm,st,tm->m", moved, covariance, moved)
    is_seen = weight > LEAST_SHARE * own
    safe = np.where(is_seen, weight, 1.0)
    rates = np.where(is_seen, causes @ gradient / safe, 0.0)
    return SteadyDrift(rates, np.where(is_seen, safe**-0.5, np.inf))
