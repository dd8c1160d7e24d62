"""What is known of an unchanged robot from all its runs so far, and how far the next one contradicts it.

Estimates of several nights share the error of the calibration that they start from, so that a test of
them one by one would alarm on a robot that has not changed. Their innovations do not: what a run shows
beyond what all runs before it predict is independent of these, if nothing changed (Kailath, An innovations
approach to least-squares estimation, IEEE Transactions on Automatic Control 13, 1968, 646-655). With the
information L carried so far, at whose estimate the new evidence has the gradient g, and the information N
of that,

    s = L (L + N)^-1 g        and its covariance        L (L + N)^-1 N,

so that ``d^T s`` over its standard deviation is the score of a change along d, standard normal without one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.drift.largest_score import largest_by_chance
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array

DIFFUSE = 1e2
"""Standard deviation of a free parameter of which nothing is known, mm or rad."""

LEAST_SHARE = 1e-3
"""Of the information of a run: what must be left of it, for a cause, by what is not known from before."""


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

    def after(self, run: RunEvidence) -> CarriedPosterior:
        """With one more run."""
        return CarriedPosterior(self.evidence + run)

    def scores(self, run: RunEvidence, causes: Array) -> Array:
        """Innovations (m,) of a run by each cause (m, s); NaN where it says nothing of a change.

        They are standard normal, and independent of all before, if the robot has not changed.
        """
        share = self._share(run)
        score = causes @ (share @ run.gradient(self.state))
        variance = np.einsum("ms,st,mt->m", causes, share @ run.information, causes)
        own = np.einsum("ms,st,mt->m", causes, run.information, causes)
        is_seen = variance > LEAST_SHARE * own
        return np.where(is_seen, score / np.sqrt(np.where(is_seen, variance, 1.0)), np.nan)

    def largest_score_by_chance(self, run: RunEvidence, causes: Array) -> float:
        """What the largest score of a run by causes (m, s), all seen, exceeds by chance."""
        covariance = causes @ self._share(run) @ run.information @ causes.T
        sigma = np.sqrt(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
        return largest_by_chance(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)

    def _share(self, run: RunEvidence) -> Array:
        """``L (L + N)^-1``."""
        information = self.evidence.information
        share: Array = np.linalg.solve(information + run.information, information).T
        return share

    def forgetting(self, cause: Array) -> CarriedPosterior:
        """The same when the robot may have changed by any amount along a cause (s,), now."""
        information, weighted = self.evidence.information, self.evidence.weighted
        along = information @ cause
        taken = along / (DIFFUSE**-2 + float(cause @ along))
        return CarriedPosterior(
            RunEvidence(information - np.outer(taken, along), weighted - taken * float(cause @ weighted))
        )

    def marginal(self, rows: list[int]) -> CarriedPosterior:
        """What is known of some numbers of the state, whatever the others are."""
        information, weighted = self.evidence.information, self.evidence.weighted
        others = [row for row in range(len(weighted)) if row not in rows]
        crossed = information[np.ix_(rows, others)]
        taken = crossed @ np.linalg.inv(information[np.ix_(others, others)])
        return CarriedPosterior(
            RunEvidence(
                information[np.ix_(rows, rows)] - taken @ crossed.T,
                weighted[rows] - taken @ weighted[others],
            )
        )

    def with_unknowns(self, sigma: Array) -> CarriedPosterior:
        """The same with further numbers (k,) of mean 0, of which nothing but their ``sigma`` is known."""
        evidence, states = self.evidence, len(self.evidence.weighted)
        information = np.diag(np.concatenate([np.zeros(states), sigma**-2.0]))
        information[:states, :states] = evidence.information
        return CarriedPosterior(
            RunEvidence(information, np.concatenate([evidence.weighted, np.zeros(len(sigma))]))
        )
