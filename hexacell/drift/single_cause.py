"""Whether a few records contradict an unchanged robot, each cause taken alone, and which leg changed.

A robot that was identified is known with a covariance C. If it has not changed, whitened residuals r of
new records have the covariance ``S = 1 + H C H^T``. A change of one parameter of the machine by b adds
``-H d b`` to them, with the derivatives d of the free parameters by that one. Against the hypothesis of no
change the most powerful test of this one cause is the score

    z = -d^T H^T S^-1 r / sqrt(d^T H^T S^-1 H d),

which is standard normal without a change (Cox and Hinkley, Theoretical Statistics, 1974, section 9.3). The
largest of all ``|z|`` is compared with what it exceeds by chance with a given probability. The scores are
correlated, in a way that is known; the limit is found by drawing them.

A leg is named, not a parameter: several parameters of a leg do nearly the same to some records, and
neighbouring legs similar things. The evidence for a leg is therefore the sum of the marginal likelihoods of
its parameters, each of which may have changed by an amount with the standard deviation ``USUAL_CHANGE``
(Kass and Raftery, Bayes factors, Journal of the American Statistical Association 90, 1995, 773-795).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.drift.run_evidence import WhitenedRecords
from hexacell.kinematics.rotations import Array

SEEN_SHARE = 1e-9
"""Share of the largest information on a parameter: one with less is not seen at all."""

FALSE_ALARMS = 0.01
"""Probability of an alarm for an unchanged robot."""

DRAWS = 40_000
"""Draws of the scores: the probability of a false alarm is then known to 5 % of itself."""

USUAL_CHANGE = 0.1
"""Standard deviation of a change, mm; 0.05 and 0.5 name the same legs in nearly all cases."""

CERTAIN = 0.99
"""Probability that the leg which changed is among those that are named."""


@dataclass(frozen=True, slots=True, eq=False)
class SingleCauseTest:
    """The scores of m causes.

    Attributes:
        scores: (m,) standard normal without a change; 0 of a cause that the records do not see.
        changes: (m,) the estimate of each change, in the unit of its parameter.
        sigmas: (m,) one standard deviation of it.
        limit: what the largest score exceeds by chance with probability ``FALSE_ALARMS``.
    """

    scores: Array
    changes: Array
    sigmas: Array
    limit: float


def single_cause_test(records: WhitenedRecords, covariance: Array, causes: Array) -> SingleCauseTest:
    """Test each of m ``causes`` (m, s), changes of the state by one unit.

    By records linearized at the previous estimate, and the ``covariance`` (s, s) of the state then; 1 for
    shared causes of which nothing is known.
    """
    rows, residuals = records.rows, records.residuals
    factor = np.linalg.cholesky(np.eye(len(rows)) + rows @ covariance @ rows.T)
    signatures = np.linalg.solve(factor, rows @ causes.T)
    found = -(signatures.T @ np.linalg.solve(factor, residuals))
    information = np.einsum("rm,rm->m", signatures, signatures)
    is_seen = information > SEEN_SHARE * information.max()
    root = np.sqrt(np.where(is_seen, information, 1.0))
    return SingleCauseTest(
        scores=np.where(is_seen, found / root, 0.0),
        changes=np.where(is_seen, found / root**2, 0.0),
        sigmas=np.where(is_seen, 1.0 / root, np.inf),
        limit=_largest_by_chance(np.where(is_seen, signatures / root, 0.0)),
    )


def _largest_by_chance(unit: Array) -> float:
    """The limit of the largest of m scores, exceeded with probability ``FALSE_ALARMS``.

    The scores are standard normal; the products of the columns of ``unit`` (r, m) are their correlations.
    """
    draws = np.random.default_rng(0).standard_normal((DRAWS, min(unit.shape)))
    factor = np.linalg.qr(unit)[1] if len(unit) > unit.shape[1] else unit
    largest = np.concatenate([np.abs(part @ factor).max(axis=1) for part in np.array_split(draws, 10)])
    return float(np.quantile(largest, 1.0 - FALSE_ALARMS))


def possible_groups(scores: Array, sigmas: Array, groups: NDArray[np.int_]) -> tuple[int, ...]:
    """Groups of causes, such as legs, of which one changed: the likeliest, with ``CERTAIN`` together.

    By the ``scores`` (m,) of single causes, and the ``sigmas`` (m,) of the estimates of each change.
    """
    with np.errstate(divide="ignore"):
        ratio = (USUAL_CHANGE / sigmas) ** 2
    evidence = 0.5 * (scores**2 * ratio / (1.0 + ratio) - np.log1p(ratio))
    of_group = {int(one): float(np.logaddexp.reduce(evidence[groups == one])) for one in np.unique(groups)}
    ordered = sorted(of_group, key=of_group.__getitem__, reverse=True)
    total = np.logaddexp.reduce(list(of_group.values()))
    together = np.cumsum([np.exp(of_group[one] - total) for one in ordered])
    return tuple(ordered[: 1 + int(np.searchsorted(together, CERTAIN))])
