"""What is known of an unchanged robot from all its runs so far, how far a new run contradicts it, and when.

Estimates of several nights share the error of the calibration that they start from, so that a test of
them one by one would alarm on a robot that has not changed. Their innovations do not: what a run shows
beyond what all runs before it predict is independent of these, if nothing changed (Kailath, An innovations
approach to least-squares estimation, IEEE Transactions on Automatic Control 13, 1968, 646-655). With the
information L carried so far, at whose estimate the new evidence has the gradient g, and the information N
of that,

    s = L (L + N)^-1 g        and its covariance        L (L + N)^-1 N,

so that ``d^T s`` over its standard deviation is the score of a change along d, standard normal without one.

**Location.** A step by b along d between two runs adds ``b N d`` to what every run after it weighs. With
the state unknown too, the likelihood is largest at

    b = u / v,    u = d^T sum g,    v = d^T (A - A T^-1 A) d,

over the runs after the step, with their gradients g at the estimate of all runs under no change, their
information A, and the information T of all. The gain ``u^2 / v`` of twice the log-likelihood is largest for
the most likely run and cause (Basseville and Nikiforov, Detection of Abrupt Changes, 1993, section 7.2.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array

DIFFUSE = 1e2
"""Standard deviation of a free parameter of which nothing is known, mm or rad."""

LEAST_SHARE = 1e-3
"""Share of a run's information on a cause that previous runs must leave, for the run to be counted."""

LIKELY = 3.84
"""Twice the log-likelihood that a step may have less than the likeliest one: 95 % for its time."""


@dataclass(frozen=True, slots=True, eq=False)
class CarriedPosterior:
    """The evidence of all runs so far, with the prior."""

    evidence: RunEvidence

    @classmethod
    def diffuse(cls, free: int, causes: int) -> CarriedPosterior:
        """Nothing known of so many free parameters; shared causes have unit variance."""
        precision = np.diag([DIFFUSE**-2] * free + [1.0] * causes)
        return cls(RunEvidence(precision, np.zeros(free + causes)))

    @property
    def state(self) -> Array:
        """The estimate (s,)."""
        found: Array = np.linalg.solve(self.evidence.information, self.evidence.weighted)
        return found

    def after(self, *runs: RunEvidence) -> CarriedPosterior:
        """The posterior with some more runs."""
        return CarriedPosterior(sum(runs, self.evidence))

    def scores(self, run: RunEvidence, causes: Array) -> Array:
        """Innovations (m,) of a run by each cause (m, s); NaN where it says nothing of a change.

        They are standard normal, and independent of all before, if the robot has not changed.
        """
        information = self.evidence.information
        share = np.linalg.solve(information + run.information, information).T
        score = causes @ (share @ run.gradient(self.state))
        variance = np.einsum("ms,st,mt->m", causes, share @ run.information, causes)
        own = np.einsum("ms,st,mt->m", causes, run.information, causes)
        is_seen = variance > LEAST_SHARE * own
        return np.where(is_seen, score / np.sqrt(np.where(is_seen, variance, 1.0)), np.nan)

    def forgetting(self, causes: Array) -> CarriedPosterior:
        """The posterior if the robot may just have changed by any amount along some causes (m, s)."""
        information, weighted = self.evidence.information, self.evidence.weighted
        for cause in causes:
            along = information @ cause
            taken = along / (DIFFUSE**-2 + float(cause @ along))
            weighted = weighted - taken * float(cause @ weighted)
            information = information - np.outer(taken, along)
        return CarriedPosterior(RunEvidence(information, weighted))


@dataclass(frozen=True, slots=True, eq=False)
class StepGains:
    """Steps before each of n runs by each of m causes.

    Attributes:
        gains: (n, m) of twice the log-likelihood.
        changes: (n, m) estimate of the step, in the unit of its cause.
        sigmas: (n, m) one standard deviation of it; infinite where the runs do not see it.
    """

    gains: Array
    changes: Array
    sigmas: Array

    @property
    def likeliest(self) -> tuple[int, int]:
        """The run that the step was before, and its cause."""
        run, cause = np.unravel_index(self.gains.argmax(), self.gains.shape)
        return int(run), int(cause)

    def likely_runs(self, cause: int) -> tuple[int, int]:
        """The first and the last run that a step by this cause may have been before."""
        gains = self.gains[:, cause]
        likely = np.flatnonzero(gains > gains.max() - LIKELY)
        return int(likely[0]), int(likely[-1])


def step_gains(before: CarriedPosterior, runs: Sequence[RunEvidence], causes: Array) -> StepGains:
    """The steps before each of n runs, by each of m causes (m, s); ``before`` is known before the first."""
    total = before.after(*runs)
    state, covariance = total.state, np.linalg.inv(total.evidence.information)
    gradient, information = np.zeros(len(state)), np.zeros_like(covariance)
    scores, weights = np.zeros((len(runs), len(causes))), np.zeros((len(runs), len(causes)))
    for place in reversed(range(len(runs))):
        gradient = gradient + runs[place].gradient(state)
        information = information + runs[place].information
        seen = information @ causes.T
        own = np.einsum("ms,sm->m", causes, seen)
        scores[place] = causes @ gradient
        weights[place] = own - np.einsum("sm,st,tm->m", seen, covariance, seen)
        weights[place][weights[place] < LEAST_SHARE * own] = 0.0
    is_seen = weights > 0.0
    safe = np.where(is_seen, weights, 1.0)
    return StepGains(
        gains=np.where(is_seen, scores**2 / safe, 0.0),
        changes=np.where(is_seen, scores / safe, 0.0),
        sigmas=np.where(is_seen, safe**-0.5, np.inf),
    )
