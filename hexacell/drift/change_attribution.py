"""What a change is of, by all runs around it: a step of one parameter, which may then move on steadily.

A step by b along a cause d, with which a motion by v a day begins, adds ``(b + t v) N d`` to what a run t
days later weighs. As for a step alone (:mod:`~hexacell.drift.step_location`), with the state
unknown too, twice the log-likelihood gains ``2 u^T y - y^T W y`` by ``y = (b, v)``, with

    u_i = d^T sum t^i g,        W_ij = d^T (sum t^(i+j) N) d - (d^T sum t^i N) T^-1 (sum t^j N d).

Steps and rates have usual sizes, so that the marginal likelihood of a cause is known too, and with it
which leg it is of: the longer a leg moves on, the surer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.drift.carried_posterior import DIFFUSE, CarriedPosterior
from hexacell.drift.causes import Causes
from hexacell.drift.largest_score import largest_of_independent
from hexacell.drift.leg_evidence import USUAL_CHANGE, legs_by_evidence
from hexacell.drift.moving_posterior import USUAL_RATE
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array

USUAL = np.array([USUAL_CHANGE, USUAL_RATE])


@dataclass(frozen=True, slots=True)
class AttributedChange:
    """What a change is of.

    Attributes:
        possible_legs: of which one changed, the likeliest first; only one where that is certain.
        cause: index of its likeliest cause.
        change, sigma: the step of that, in its unit, as far as it had come by the first run after it.
        rate, rate_sigma: by how much it has moved on since, in its unit a day.
        moves_on: whether it surely has.
    """

    possible_legs: tuple[int, ...]
    cause: int
    change: float
    sigma: float
    rate: float
    rate_sigma: float
    moves_on: bool


def attributed_change(
    before: CarriedPosterior, runs: Sequence[RunEvidence], days: Array, place: int, causes: Causes
) -> AttributedChange:
    """A change before the run at ``place``, of runs on ``days`` (n,), by what is known before the first.

    The ``causes`` are changes of the state that is known, which may have rates as well.
    """
    found, covariances, evidence = _steps_and_rates(
        before, runs, days - days[place], place, causes.by_state
    )
    legs = legs_by_evidence(evidence, causes.legs)
    cause = int(np.where(causes.legs == legs[0], evidence, -np.inf).argmax())
    change, rate = found[cause].tolist()
    sigma, rate_sigma = np.sqrt(np.diag(covariances[cause])).tolist()
    return AttributedChange(
        possible_legs=legs,
        cause=cause,
        change=change,
        sigma=sigma,
        rate=rate,
        rate_sigma=rate_sigma,
        moves_on=abs(rate) > largest_of_independent(len(evidence)) * rate_sigma,
    )


def _steps_and_rates(
    before: CarriedPosterior, runs: Sequence[RunEvidence], days: Array, place: int, causes: Array
) -> tuple[Array, Array, Array]:
    """Step and rate (m, 2) by each cause, their covariances (m, 2, 2), and the evidence (m,) for it."""
    total = before
    for run in runs:
        total = total.after(run)
    state, covariance = total.state, np.linalg.inv(total.evidence.information)
    changed = list(zip(days[place:].tolist(), runs[place:], strict=True))
    gradients = [np.sum([t**i * run.gradient(state) for t, run in changed], axis=0) for i in range(2)]
    moved = [np.sum([t**i * run.information for t, run in changed], axis=0) for i in range(3)]
    scores = np.stack([causes @ one for one in gradients], axis=-1)
    shared = np.stack([causes @ one for one in moved[:2]], axis=1)
    own = np.stack([np.einsum("ms,st,mt->m", causes, one, causes) for one in moved], axis=-1)
    weights = own[:, [[0, 1], [1, 2]]] - np.einsum("mis,st,mjt->mij", shared, covariance, shared)
    usual = np.einsum("mi,mij,mj->m", scores, np.linalg.inv(weights + np.diag(USUAL**-2)), scores)
    volume = np.linalg.slogdet(np.eye(2) + weights * USUAL**2)[1]
    spread = np.linalg.inv(weights + np.diag([DIFFUSE**-2, USUAL_RATE**-2]))
    return np.einsum("mij,mj->mi", spread, scores), spread, 0.5 * (usual - volume)
