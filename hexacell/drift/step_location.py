"""When a robot changed, by which cause, and by how much: the most likely single step in a series of runs.

A step by b along a cause d between two runs adds ``b N d`` to what every run after it weighs. With the
state unknown too, the likelihood is largest at

    b = u / v,    u = d^T sum g,    v = d^T (A - A T^-1 A) d,

over the runs after the step, with their gradients g at the estimate of all runs under no change, their
information A, and the information T of all. The gain ``u^2 / v`` of twice the log-likelihood is largest for
the most likely run and cause (Basseville and Nikiforov, Detection of Abrupt Changes, 1993, section 7.2.4:
the generalized likelihood ratio test of Willsky and Jones).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.drift.carried_posterior import LEAST_SHARE, CarriedPosterior
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array

LIKELY = 3.84
"""Twice the log-likelihood that a step may have less than the likeliest one: 95 % for its time."""


@dataclass(frozen=True, slots=True, eq=False)
class StepGains:
    """Steps before each of n runs by each of m causes.

    Attributes:
        gains: (n, m) of twice the log-likelihood.
        changes: (n, m) estimate of the step, in the unit of its cause.
        sigmas: (n, m) one standard deviation of it; infinite where nothing tells.
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
    total = before
    for run in runs:
        total = total.after(run)
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
    return _gains(scores, weights)


def _gains(scores: Array, weights: Array) -> StepGains:
    is_seen = weights > 0.0
    safe = np.where(is_seen, weights, 1.0)
    return StepGains(
        gains=np.where(is_seen, scores**2 / safe, 0.0),
        changes=np.where(is_seen, scores / safe, 0.0),
        sigmas=np.where(is_seen, safe**-0.5, np.inf),
    )
